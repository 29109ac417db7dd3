//! What the system says of a run, and how fast the machine is at that moment: so that no program is judged by its own word.

use std::fs;
use std::hint::black_box;
use std::time::Instant;

use anyhow::ensure;
use serde::{Deserialize, Serialize};

use crate::programs::Call;

/// Time of a process from start to end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Outside {
    pub(crate) wall_seconds: f64,
    /// In steps of 10 ms; only Linux tells.
    pub(crate) cpu_seconds: Option<f64>,
}

/// Runs a program and measures it.
///
/// # Errors
/// When it fails.
pub(crate) fn measure(call: &Call) -> anyhow::Result<Outside> {
    let (start, cpu) = (Instant::now(), children_cpu_seconds());
    call.run()?;
    let wall_seconds = start.elapsed().as_secs_f64();
    let cpu_seconds = children_cpu_seconds().zip(cpu).map(|(after, before)| after - before);
    Ok(Outside { wall_seconds, cpu_seconds })
}

impl Outside {
    /// Holds what a program says of its time against this.
    ///
    /// # Errors
    /// When the program leaves out more than starting and ending can take, or claims more than there was.
    pub(crate) fn confirm(&self, wall_seconds: f64, cpu_seconds: f64) -> anyhow::Result<()> {
        let measured = [
            ("wall", wall_seconds, Some(self.wall_seconds)),
            ("CPU", cpu_seconds, self.cpu_seconds),
        ];
        for (clock, said, measured) in measured {
            let Some(measured) = measured else { continue };
            // Loading the program and giving back its memory take some hundredths; a loaded machine delays both.
            ensure!(
                (measured - said).abs() <= 0.15 + 0.1 * measured,
                "the program accounts for {said:.2} {clock} seconds, the system for {measured:.2}"
            );
        }
        Ok(())
    }
}

/// CPU seconds of all processes that this one has started and that have ended.
fn children_cpu_seconds() -> Option<f64> {
    let text = fs::read_to_string("/proc/self/stat").ok()?;
    // The second field is a name in brackets, which may hold anything; the third follows it. Fields 16 and 17, see
    // proc(5), count in ticks of 1/100 s.
    let fields: Vec<&str> = text.rsplit_once(") ")?.1.split_whitespace().collect();
    let ticks = |field: usize| fields.get(field - 3)?.parse::<f64>().ok();
    Some((ticks(16)? + ticks(17)?) / 100.0)
}

/// CPU seconds of a fixed piece of work, arithmetic and reads all over 32 MB in equal parts: what a second is worth here.
pub(crate) fn yardstick() -> f64 {
    const N: usize = 1 << 23;
    let table: Vec<u32> = (0..N as u32).map(|i| i.wrapping_mul(2_654_435_761)).collect();
    let (start, cpu) = (Instant::now(), thread_cpu_seconds());
    let mut state = 1_u32;
    for _ in 0..1_200_000 {
        state = table[state as usize % N].wrapping_add(state.rotate_left(5));
    }
    let mut x = 1.0_f32;
    for _ in 0..20_000_000 {
        x = x * 0.999_9 + 0.000_1 / x;
    }
    black_box((state, x));
    match (thread_cpu_seconds(), cpu) {
        (Some(after), Some(before)) => after - before,
        _ => start.elapsed().as_secs_f64(),
    }
}

/// CPU seconds of this thread, to the nanosecond; only Linux tells.
fn thread_cpu_seconds() -> Option<f64> {
    let text = fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn a_program_is_measured() {
        // Some hundredths of a second of work in a shell.
        let call = Call::new(Path::new("/bin/sh"))
            .args(["-c", "i=0; while [ $i -lt 300000 ]; do i=$((i+1)); done"]);
        let outside = measure(&call).unwrap();
        assert!(outside.wall_seconds > 0.0, "{outside:?}");
        if cfg!(target_os = "linux") {
            assert!(outside.cpu_seconds.unwrap() > 0.01, "{outside:?}");
            assert!(outside.cpu_seconds.unwrap() < outside.wall_seconds + 0.02, "{outside:?}");
        }
        assert!(measure(&Call::new(Path::new("/bin/sh")).args(["-c", "exit 3"])).is_err());
    }

    #[test]
    fn a_program_that_hides_time_is_found_out() {
        let outside = Outside { wall_seconds: 2.0, cpu_seconds: Some(4.0) };
        outside.confirm(1.98, 3.9).unwrap();
        let said = |wall, cpu| outside.confirm(wall, cpu).unwrap_err().to_string();
        assert_eq!(
            said(2.0, 2.0),
            "the program accounts for 2.00 CPU seconds, the system for 4.00"
        );
        assert_eq!(
            said(1.0, 4.0),
            "the program accounts for 1.00 wall seconds, the system for 2.00"
        );
        assert_eq!(
            said(2.0, 9.0),
            "the program accounts for 9.00 CPU seconds, the system for 4.00"
        );
    }

    #[test]
    fn the_yardstick_takes_time() {
        let seconds = yardstick();
        assert!((0.001..10.0).contains(&seconds), "{seconds} s");
    }
}
