//! Ctrl-C.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use base::Interrupted;

/// Whether the user has asked for an end, by Ctrl-C or a signal to terminate. Asking twice ends the process at once.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Listens from now on. One per process: where a handler is there already, none is added.
    pub fn listen() -> Self {
        let interrupt = Self::default();
        let flag = interrupt.clone();
        // Without the handler, Ctrl-C ends the process as it always does.
        let _ = ctrlc::set_handler(move || {
            if flag.0.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        });
        interrupt
    }

    /// Whether to go on.
    pub fn go_on(&self) -> bool {
        !self.0.load(Ordering::Relaxed)
    }

    /// To be asked between stages, above all before outputs are written.
    ///
    /// # Errors
    /// When the user has asked for an end.
    pub fn check(&self) -> Result<(), Interrupted> {
        if self.go_on() { Ok(()) } else { Err(Interrupted) }
    }
}
