//! Ctrl-C.

use std::fmt;
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use base::Interrupted;

/// How long a program may take to end by itself. The rest of a second is for keeping what was done.
const PATIENCE: Duration = Duration::from_millis(400);

/// Keeps what was done, and says in words what was and wasn't.
type Farewell = Box<dyn FnMut() -> String + Send>;

/// Whether the user has asked for an end, by Ctrl-C or a signal to terminate.
///
/// Stages ask [`Interrupt::go_on`] between pieces of work. Some work has no pieces: a program that hasn't ended soon is
/// ended. Asking twice ends it at once. In either case nothing half written stays behind.
#[derive(Clone)]
pub struct Interrupt {
    is_asked: Arc<AtomicBool>,
    farewell: Arc<Mutex<Farewell>>,
}

impl fmt::Debug for Interrupt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Interrupt({})", if self.go_on() { "not asked" } else { "asked" })
    }
}

impl Interrupt {
    /// Listens from now on; `words` say what an end leaves undone. One per process: where a handler is there already,
    /// none is added.
    pub fn listen(program: &'static str, words: &'static str) -> Self {
        let interrupt = Self {
            is_asked: Arc::new(AtomicBool::new(false)),
            farewell: Arc::new(Mutex::new(Box::new(|| words.into()))),
        };
        let heard = interrupt.clone();
        // Without the handler, Ctrl-C ends the process as it always does.
        let _ = ctrlc::set_handler(move || {
            if heard.is_asked.swap(true, Ordering::Relaxed) {
                heard.end(program);
            }
            let heard = heard.clone();
            thread::spawn(move || {
                thread::sleep(PATIENCE);
                heard.end(program);
            });
        });
        interrupt
    }

    /// Whether to go on.
    pub fn go_on(&self) -> bool {
        !self.is_asked.load(Ordering::Relaxed)
    }

    /// To be asked between stages, above all before outputs are written.
    ///
    /// # Errors
    /// When the user has asked for an end.
    pub fn check(&self) -> Result<(), Interrupted> {
        if self.go_on() { Ok(()) } else { Err(Interrupted) }
    }

    /// From now on an end does this first, and says what it answers.
    pub fn at_end(&self, farewell: impl FnMut() -> String + Send + 'static) {
        *self.farewell.lock().unwrap_or_else(PoisonError::into_inner) = Box::new(farewell);
    }

    /// The error as it is, or, if it tells of an interruption, with what that leaves behind.
    pub fn explain(&self, error: anyhow::Error) -> anyhow::Error {
        if error.is::<Interrupted>() { error.context(self.farewell()) } else { error }
    }

    fn farewell(&self) -> String {
        self.farewell.lock().unwrap_or_else(PoisonError::into_inner)()
    }

    fn end(&self, program: &str) {
        let words = self.farewell();
        atomic_file::abandon();
        // Nobody is left to be told if this fails.
        let _ = writeln!(io::stderr(), "{program}: {words}: {Interrupted}");
        std::process::exit(130);
    }
}
