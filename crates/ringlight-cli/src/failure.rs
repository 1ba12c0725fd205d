//! How the command ends.

use ringlight::scene::SceneError;
use ringlight::transport;
use std::fmt;

/// Ends with valid output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Converged, or `--max-shots` reached, or nothing was to be solved.
    Done,
    /// Stopped by the time limit, from the page or for want of memory.
    StoppedEarly,
    /// Stopped by SIGINT.
    Interrupted,
    /// Stopped by SIGTERM.
    Terminated,
}

impl End {
    /// The exit code.
    pub fn code(self) -> u8 {
        match self {
            End::Done => 0,
            End::StoppedEarly => 4,
            End::Interrupted => 130,
            End::Terminated => 143,
        }
    }
}

/// Ends without all the output asked for.
#[derive(Debug)]
pub enum Failure {
    /// The command line makes no sense with this scene.
    Usage(String),
    /// The scene cannot be used.
    Scene(SceneError),
    /// Anything else.
    Other(anyhow::Error),
    /// Something panicked.
    Bug(String),
}

impl Failure {
    /// The exit code.
    pub fn code(&self) -> u8 {
        match self {
            Failure::Usage(_) => 2,
            Failure::Scene(error) if !error.lacks_memory => 3,
            Failure::Scene(_) | Failure::Other(_) | Failure::Bug(_) => 1,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Failure::Usage(message) => f.write_str(message),
            Failure::Scene(error) => error.fmt(f),
            // The causes on one line, outermost first.
            Failure::Other(error) => write!(f, "{error:#}"),
            Failure::Bug(panic) => {
                write!(f, "this is a bug in ringlight: {panic}; please report it with the command line")
            }
        }
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Failure {
        Failure::Scene(error)
    }
}

impl From<transport::Failure> for Failure {
    fn from(failure: transport::Failure) -> Failure {
        Failure::Other(failure.into())
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Failure {
        Failure::Other(error)
    }
}
