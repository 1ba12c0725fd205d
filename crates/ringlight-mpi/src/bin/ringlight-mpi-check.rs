//! Checks that an installation of MPI carries Ringlight's messages: `mpirun -n 4 ringlight-mpi-check`.
//!
//! With `fail`, the last rank fails; with `hang`, it does not answer while the first one fails; with `die`, it is gone
//! without a word. For tests of what the others do then.

use ringlight::transport::{Communicator, Failure, conformance};
use std::process::ExitCode;
use std::time::Duration;

fn main() -> ExitCode {
    let case = std::env::args().nth(1);
    // Small pieces, so that the suite's large messages go in many.
    let result = ringlight_mpi::start_with_pieces(1 << 20, |ranks| {
        let result = match case.as_deref() {
            None => conformance::check(ranks),
            Some(case) => ranks.run(|ranks| misbehave(case, ranks)),
        };
        match &result {
            Ok(()) if ranks.rank() == 0 => println!("{} ranks conform", ranks.size()),
            Err(failure) if ranks.failed_here() || case.is_none() => eprintln!("error: {failure}"),
            _ => {}
        }
        result.is_ok()
    });
    match result {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(unavailable) => {
            eprintln!("error: {unavailable}");
            ExitCode::FAILURE
        }
    }
}

/// One rank ends badly while the others wait for a message that never comes.
fn misbehave(case: &str, ranks: &mut Communicator<'_>) -> Result<(), Failure> {
    let (this, last) = (ranks.rank(), ranks.size() - 1);
    match case {
        "fail" if this == last => return Err(Failure { rank: this, message: "cannot go on".into() }),
        "hang" if this == 0 => return Err(Failure { rank: this, message: "cannot go on".into() }),
        "hang" if this == last => std::thread::sleep(Duration::from_secs(600)),
        "die" if this == last => std::process::abort(),
        _ => {}
    }
    ranks.wait_for(last, 1).map(|_| ())
}
