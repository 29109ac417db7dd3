//! The command line, as a shell would take it.

use std::ffi::OsString;
use std::path::Path;

/// A command line that does the same again: program name without its folder, arguments quoted where a shell needs it.
pub fn command_line(args: impl IntoIterator<Item = OsString>) -> String {
    let mut args = args.into_iter();
    let program = args.next().unwrap_or_default();
    let program =
        Path::new(&program).file_name().unwrap_or_default().to_string_lossy().into_owned();
    std::iter::once(program)
        .chain(args.map(|a| quote(&a.to_string_lossy())))
        .collect::<Vec<_>>()
        .join(" ")
}

fn quote(arg: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./,:=+@%".contains(c);
    if !arg.is_empty() && arg.chars().all(is_plain) {
        arg.into()
    } else {
        format!("'{}'", arg.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotes_what_a_shell_would_split() {
        let line = command_line(
            ["/usr/bin/photon-build", "my scene.toml", "-o", "it's.photons", ""]
                .map(OsString::from),
        );
        assert_eq!(line, r"photon-build 'my scene.toml' -o 'it'\''s.photons' ''");
    }
}
