//! Where a command runs: which ranks there are, and how they speak. The only place of the command that knows MPI.

use crate::failure::{End, Failure};
use crate::machine;
use ringlight::transport::{self, Communicator, threads};
use std::io::Write;
use std::panic::{self, AssertUnwindSafe};
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Tag of the command's own messages: collective operations, which may follow each other with one tag.
pub const COMMAND: u32 = 1000;

/// Where a command runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Launch {
    /// One rank: this process.
    Alone,
    /// So many ranks, threads of this process.
    Threads(usize),
    /// This process is one of the ranks that an MPI launcher has started.
    Mpi,
}

/// What each rank does.
type Body<'a> = &'a (dyn Fn(&mut Communicator<'_>) -> Result<End, Failure> + Sync);

impl Launch {
    /// Where a command that can be spread over ranks runs; `ranks` is what `--ranks` says.
    pub fn spread(ranks: Option<usize>) -> Result<Launch, Failure> {
        match (launched(), ranks) {
            (Some(_), Some(_)) => {
                let advice = "--ranks is for ranks without MPI; the MPI launcher's -n says how many ranks there are";
                Err(Failure::Usage(advice.into()))
            }
            (Some(Launched { size: Some(1), .. }), None) | (None, None | Some(1)) => Ok(Launch::Alone),
            (Some(_), None) => Ok(Launch::Mpi),
            (None, Some(ranks)) => Ok(Launch::Threads(ranks)),
        }
    }

    /// Where a command runs that has one rank.
    pub fn alone(verb: &str) -> Result<Launch, Failure> {
        match launched() {
            None | Some(Launched { size: Some(1), .. }) => Ok(Launch::Alone),
            Some(_) => Err(Failure::Usage(format!("{verb} runs on one rank; start it without the MPI launcher"))),
        }
    }

    /// Runs `body` on all ranks, each with so many threads: by default, as many as its share of the cores.
    pub fn run(self, threads: Option<usize>, body: Body<'_>) -> ExitCode {
        let code = match self {
            Launch::Alone => Ok(run_rank(&mut Communicator::alone(), threads, body)),
            Launch::Threads(size) => threads::start(size, |ranks| run_rank(ranks, threads, body))
                .map(|codes| codes.into_iter().map(|code| code.unwrap_or(1)).next().unwrap_or(1))
                .map_err(Failure::from),
            Launch::Mpi => over_mpi(|ranks| run_rank(ranks, threads, body)),
        };
        code.map_or_else(|failure| refuse(&failure), ExitCode::from)
    }
}

/// The door to MPI.
#[cfg(feature = "mpi")]
fn over_mpi<T>(body: impl FnOnce(&mut Communicator<'_>) -> T) -> Result<T, Failure> {
    ringlight_mpi::start(body).map_err(|unavailable| Failure::Other(unavailable.into()))
}

/// The door to MPI, which is not there.
#[cfg(not(feature = "mpi"))]
fn over_mpi<T>(_: impl FnOnce(&mut Communicator<'_>) -> T) -> Result<T, Failure> {
    Err(Failure::Other(anyhow::anyhow!(
        "an MPI launcher has started this ringlight, which is built without MPI; build it with \
         `cargo install --path crates/ringlight-cli --features mpi`, or use --ranks N without the launcher"
    )))
}

/// What an MPI launcher tells the processes that it starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Launched {
    rank: usize,
    /// Number of processes, where it is told.
    size: Option<usize>,
}

fn launched() -> Option<Launched> {
    launched_by(|name| std::env::var(name).ok())
}

fn launched_by(variable: impl Fn(&str) -> Option<String>) -> Option<Launched> {
    // Open MPI; MPICH and what descends from it; any other over PMIx, as Slurm's srun.
    const LAUNCHERS: [(&str, &str); 3] = [
        ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"),
        ("PMI_RANK", "PMI_SIZE"),
        ("PMIX_RANK", "SLURM_STEP_NUM_TASKS"),
    ];
    let number = |name: &str| variable(name)?.trim().parse().ok();
    LAUNCHERS.iter().find_map(|(rank, size)| Some(Launched { rank: number(rank)?, size: number(size) }))
}

/// Whether this process speaks for all: it is the first of those that were started together.
pub fn speaks() -> bool {
    launched().is_none_or(|launched| launched.rank == 0)
}

/// Says why nothing is done; once, however many processes were started. The code is the first one's: launchers end all
/// processes when any fails, which might be before it has spoken.
pub fn refuse(failure: &Failure) -> ExitCode {
    if !speaks() {
        return ExitCode::SUCCESS;
    }
    complain(failure);
    failure.code().into()
}

/// Prints an error; a closed standard error is no reason to fail differently.
fn complain(failure: &Failure) {
    writeln!(std::io::stderr(), "error: {failure}").ok();
}

/// Runs one rank's part; returns the exit code, the same on all ranks.
fn run_rank(ranks: &mut Communicator<'_>, threads: Option<usize>, body: Body<'_>) -> u8 {
    let start = Instant::now();
    ranks.time_waits(Box::new(move || start.elapsed().as_secs_f64()));
    let result = ranks.run(|ranks| {
        let _pool = start_threads(ranks, threads)?;
        // Unwinding removes files that are half-written.
        panic::catch_unwind(AssertUnwindSafe(|| body(ranks))).unwrap_or_else(|_| Err(Failure::Bug(first_panic())))
    });
    // The code is that of the lowest rank that failed, else the first rank's.
    let own = match &result {
        Ok(end) if ranks.rank() == 0 => end.code(),
        Err(failure) if ranks.failed_here() => failure.code(),
        _ => 0,
    };
    let codes = ranks.run(|ranks| ranks.all_gather(COMMAND, vec![own]));
    if ranks.rank() == 0 {
        // Its own failure, or what it has heard of another's.
        result.err().iter().for_each(complain);
    }
    codes.map_or(1, |codes| codes.concat().into_iter().find(|&code| code != 0).unwrap_or(0))
}

/// Makes the calling thread the first of a pool of its own, in which its parallel work is done.
fn start_threads(ranks: &mut Communicator<'_>, threads: Option<usize>) -> Result<rayon::ThreadPool, Failure> {
    let place = format!("{} {}", machine::host(), machine::allowed_cores());
    let sharing = ranks_with_the_same(ranks, &place)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = threads.unwrap_or((cores / sharing).max(1));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).use_current_thread().build();
    pool.map_err(|error| anyhow::Error::new(error).context("threads cannot be started").into())
}

/// How many ranks, this one included, say the same.
pub fn ranks_with_the_same(ranks: &mut Communicator<'_>, words: &str) -> Result<usize, transport::Failure> {
    let all = ranks.all_gather(COMMAND, words.into())?;
    Ok(all.iter().filter(|other| other.as_slice() == words.as_bytes()).count())
}

/// Work for the first rank alone, such as looks at files that it will write; the others wait until it is done.
pub fn on_first_rank(ranks: &mut Communicator<'_>, work: impl FnOnce() -> Result<(), Failure>) -> Result<(), Failure> {
    if ranks.rank() == 0 {
        work()?;
    }
    ranks.broadcast(0, COMMAND, Vec::new())?;
    Ok(())
}

/// What the first panic of this process said.
static PANIC: Mutex<Option<String>> = Mutex::new(None);

/// From now on a panic is not printed where it happens, but told as the failure of its rank.
pub fn catch_panics() {
    panic::set_hook(Box::new(|panic| {
        PANIC.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| panic.to_string());
    }));
}

fn first_panic() -> String {
    PANIC.lock().unwrap_or_else(PoisonError::into_inner).clone().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn launchers_are_known_by_their_variables() {
        let told = |variables: &[(&str, &str)]| {
            launched_by(|name| variables.iter().find(|(known, _)| *known == name).map(|(_, value)| value.to_string()))
        };
        assert_eq!(told(&[]), None);
        assert_eq!(told(&[("SLURM_STEP_NUM_TASKS", "4"), ("OMPI_COMM_WORLD_SIZE", "4")]), None);
        let open_mpi = [("OMPI_COMM_WORLD_RANK", "2"), ("OMPI_COMM_WORLD_SIZE", "4"), ("PMIX_RANK", "2")];
        assert_eq!(told(&open_mpi), Some(Launched { rank: 2, size: Some(4) }));
        assert_eq!(told(&[("PMI_RANK", "0"), ("PMI_SIZE", "8")]), Some(Launched { rank: 0, size: Some(8) }));
        assert_eq!(told(&[("PMIX_RANK", "1")]), Some(Launched { rank: 1, size: None }));
    }

    #[test]
    fn a_failure_on_any_rank_decides_the_code_of_all() {
        for (failing, code) in [(0, 2), (2, 2)] {
            let codes = threads::start(3, |ranks| {
                run_rank(ranks, Some(1), &|ranks: &mut Communicator<'_>| match ranks.rank() {
                    rank if rank == failing => Err(Failure::Usage("this is tested".into())),
                    _ => Ok(ranks.wait_for(failing, 1).map(|_| End::Done)?),
                })
            });
            assert!(codes.expect("threads start").into_iter().all(|found| found.is_ok_and(|found| found == code)));
        }
        catch_panics();
        let codes = threads::start(3, |ranks| {
            run_rank(ranks, Some(2), &|ranks: &mut Communicator<'_>| {
                let rank = ranks.rank();
                rayon::join(|| assert_ne!(rank, 1, "rank 1 dislikes its number"), || ());
                Ok(ranks.wait_for(1, 1).map(|_| End::Done)?)
            })
        });
        assert!(codes.expect("threads start").into_iter().all(|found| found.is_ok_and(|found| found == 1)));
        assert!(Failure::Bug(first_panic()).to_string().contains("dislikes its number"));
        let ends = [End::StoppedEarly, End::Interrupted, End::Done];
        let codes =
            threads::start(3, |ranks| run_rank(ranks, Some(1), &|ranks: &mut Communicator<'_>| Ok(ends[ranks.rank()])));
        assert!(codes.expect("threads start").into_iter().all(|found| found.is_ok_and(|found| found == 4)));
    }
}
