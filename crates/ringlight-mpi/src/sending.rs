//! A message on its way out, and the buffer that MPI reads it from.
#![allow(unsafe_code, reason = "MPI reads the buffer until the request is complete, which no lifetime can express")]

use mpi::Tag;
use mpi::point_to_point::Destination;
use mpi::request::{Request, StaticScope};

/// A send that has not completed yet. Dropping it keeps its buffer for ever, because MPI may still read it.
pub struct Sending {
    request: Request<'static, [u8]>,
    buffer: *mut [u8],
}

impl Sending {
    /// Starts to send; returns at once.
    pub fn start(receiver: &impl Destination, tag: u32, bytes: Vec<u8>) -> Sending {
        let buffer = Box::into_raw(bytes.into_boxed_slice());
        // SAFETY: `buffer` comes from a box that is not freed and not written to before the request is complete.
        let content: &'static [u8] = unsafe { &*buffer };
        Sending { request: receiver.immediate_send_with_tag(StaticScope, content, tag as Tag), buffer }
    }

    /// Frees the buffer if MPI has read it; otherwise gives the send back.
    pub fn test(self) -> Option<Sending> {
        let Sending { request, buffer } = self;
        match request.test() {
            Ok(_) => {
                // SAFETY: the request is complete and gone, and with it the only reference to the box's content.
                drop(unsafe { Box::from_raw(buffer) });
                None
            }
            Err(request) => Some(Sending { request, buffer }),
        }
    }
}
