//! Programs beside ours: what other libraries do with the same rays and photons, in the same run.
//!
//! They are compiled by `cargo xtask bench micro` from `xtask/peers`, which tells their folder; without it they are left
//! out.

use std::env;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use tempfile::NamedTempFile;

/// The environment variable that names the folder.
const FOLDER: &str = "TETRALUX_PEERS";

/// A program that has read its input and waits for questions.
pub(crate) struct Program {
    name: &'static str,
    child: Child,
    questions: ChildStdin,
    answers: BufReader<ChildStdout>,
    _input: NamedTempFile,
}

impl Program {
    /// Starts a program with these arrays, if it is there.
    pub(crate) fn start(name: &'static str, arrays: &[Vec<f32>]) -> Option<Self> {
        let folder = env::var_os(FOLDER)?;
        let program = Path::new(&folder).join(name);
        if !program.exists() {
            return None;
        }
        let mut input = NamedTempFile::new().expect("there is room for its input");
        for array in arrays {
            let values: Vec<u8> = array.iter().flat_map(|value| value.to_le_bytes()).collect();
            let bytes = [&(array.len() as u64).to_le_bytes()[..], &values].concat();
            input.write_all(&bytes).expect("there is room for its input");
        }
        let mut child = Command::new(program)
            .arg(input.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("it was compiled for this machine");
        let questions = child.stdin.take().expect("it is piped");
        let answers = BufReader::new(child.stdout.take().expect("it is piped"));
        Some(Self { name, child, questions, answers, _input: input })
    }

    /// Asks a question. The answer: a checksum and the time.
    pub(crate) fn ask(&mut self, question: &str) -> (f64, Duration) {
        writeln!(self.questions, "{question}").expect("it reads what it is asked");
        let mut line = String::new();
        self.answers.read_line(&mut line).expect("it answers");
        let mut words = line.split_whitespace();
        let mut number = || words.next().and_then(|word| word.parse::<f64>().ok());
        let (sum, nanoseconds) = (number(), number());
        let answer = sum.zip(nanoseconds);
        let (sum, nanoseconds) = answer.unwrap_or_else(|| panic!("{} said {line:?}", self.name));
        (sum, Duration::from_nanos(nanoseconds as u64))
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        // It ends when nobody can ask any more, but what it works at may take a while.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
