//! Questions about what is in the way, asked in straight code.
//!
//! What is asked next depends as a rule on what was answered before. Where all triangles are held, an [`Inquiry`] is
//! answered at once. Over a ring whoever asks is a suspended future until the answer has come home, and others go on
//! meanwhile: `solve/asking.rs` wakes it. Answers are the same either way, to the bit.

use super::Mesh;
use super::walk::{self, Query, Walk};
use rayon::prelude::*;
use ringlight_visibility::{Hierarchy, Hit, Points, Shooter};
use std::future::poll_fn;
use std::pin::pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll, Waker};

/// A way to ask what is in the way.
#[derive(Clone, Debug)]
pub enum Inquiry<'a> {
    /// All triangles are held here.
    Here(&'a Mesh, Arc<Hierarchy>),
    /// Others are to be asked.
    Away(Arc<Mailbox>),
}

/// What is asked together.
#[derive(Clone, Debug)]
pub enum Question {
    /// What rays hit first.
    Hits(Vec<Query>),
    /// Which cells of a shooter points see, of those in their masks: coordinates, plane ids and masks.
    Masks(Shooter, [Vec<f32>; 3], Vec<u32>, Vec<u64>),
}

/// What is answered, in the order of what was asked.
#[derive(Clone, Debug)]
pub enum Answer {
    /// Nearest hits.
    Hits(Vec<Option<Hit>>),
    /// Masks.
    Masks(Vec<u64>),
}

/// Where a question waits for whoever carries it, and the answer for whoever has asked.
#[derive(Debug)]
pub struct Mailbox {
    content: Mutex<Content>,
    /// Most rays or points of a question.
    most: usize,
}

#[derive(Debug)]
enum Content {
    Nothing,
    Question(Question),
    Answer(Answer),
}

/// So many rays are worth the work of several threads.
const MANY: usize = 512;

/// Rays that a thread takes at a time.
const SOME: usize = 64;

/// Walks that are followed side by side: few enough to stay at hand.
const ABREAST: usize = 128;

impl Mailbox {
    /// Empty, for questions of at most so many rays or points.
    pub fn new(most: usize) -> Mailbox {
        Mailbox { content: Mutex::new(Content::Nothing), most }
    }

    /// Takes the question, if there is one.
    pub fn question(&self) -> Option<Question> {
        match self.replace(Content::Nothing) {
            Content::Question(question) => Some(question),
            other => {
                self.replace(other);
                None
            }
        }
    }

    /// Leaves the answer.
    pub fn answer(&self, answer: Answer) {
        self.replace(Content::Answer(answer));
    }

    /// Leaves a question and waits for its answer.
    async fn ask(&self, question: Question) -> Answer {
        self.replace(Content::Question(question));
        poll_fn(|_| match self.replace(Content::Nothing) {
            Content::Answer(answer) => Poll::Ready(answer),
            other => {
                self.replace(other);
                Poll::Pending
            }
        })
        .await
    }

    fn replace(&self, content: Content) -> Content {
        std::mem::replace(&mut *self.content.lock().unwrap_or_else(PoisonError::into_inner), content)
    }
}

/// What a task comes to whose inquiries are all answered here.
pub fn at_once<F: Future>(task: F) -> F::Output {
    match pin!(task).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(output) => output,
        Poll::Pending => unreachable!("questions are answered at once where all triangles are held"),
    }
}

/// Gives walks the hits of what they ask.
fn tell<W: Walk>(walks: &mut [W], hits: Vec<Option<Hit>>) {
    walks.iter_mut().filter(|walk| walk.query().is_some()).zip(hits).for_each(|(walk, hit)| walk.answer(hit));
}

impl Inquiry<'_> {
    /// What rays hit first.
    pub async fn nearest_hits(&self, queries: &[Query]) -> Vec<Option<Hit>> {
        match self {
            Inquiry::Here(mesh, hierarchy) => match queries.len() {
                ..MANY => walk::nearest_hits(mesh, hierarchy, queries),
                _ => queries.par_chunks(SOME).flat_map_iter(|some| walk::nearest_hits(mesh, hierarchy, some)).collect(),
            },
            Inquiry::Away(mailbox) => {
                let mut hits = Vec::with_capacity(queries.len());
                for some in queries.chunks(mailbox.most) {
                    if let Answer::Hits(found) = mailbox.ask(Question::Hits(some.to_vec())).await {
                        hits.extend(found);
                    }
                }
                hits
            }
        }
    }

    /// Clears the bits of the shooter's cells that points do not see.
    pub async fn clear_blocked(&self, shooter: &Shooter, points: Points<'_>, masks: &mut [u64]) {
        match self {
            Inquiry::Here(_, hierarchy) => {
                hierarchy.clear_blocked(shooter, points, masks);
            }
            Inquiry::Away(mailbox) => {
                let Points { x, y, z, plane } = points;
                let mut first = 0;
                for masks in masks.chunks_mut(mailbox.most) {
                    let some = first..first + masks.len();
                    first = some.end;
                    let coordinates = [x, y, z].map(|values| values[some.clone()].to_vec());
                    let question = Question::Masks(shooter.clone(), coordinates, plane[some].to_vec(), masks.to_vec());
                    if let Answer::Masks(seen) = mailbox.ask(question).await {
                        masks.copy_from_slice(&seen);
                    }
                }
            }
        }
    }

    /// Follows walks to their ends, side by side.
    pub async fn follow<W: Walk, Walks: AsMut<[W]>>(&self, mut walks: Walks) -> Walks {
        let all = walks.as_mut();
        if let Inquiry::Here(mesh, hierarchy) = self {
            for some in all.chunks_mut(ABREAST) {
                loop {
                    let queries: Vec<Query> = some.iter().filter_map(W::query).collect();
                    if queries.is_empty() {
                        break;
                    }
                    tell(some, walk::nearest_hits(mesh, hierarchy, &queries));
                }
            }
            return walks;
        }
        loop {
            let queries: Vec<Query> = all.iter().filter_map(W::query).collect();
            if queries.is_empty() {
                return walks;
            }
            let hits = self.nearest_hits(&queries).await;
            tell(all, hits);
        }
    }
}
