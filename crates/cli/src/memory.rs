//! Memory: what a run will need, and what there is for it.

use std::fs;
use std::hint::black_box;
use std::path::{Path, PathBuf};

use anyhow::bail;
use nix::sys::resource::{Resource, getrlimit};

use crate::{Console, peak_rss_bytes};

/// What is done about a run that needs more memory than there is.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub struct MemoryOptions {
    /// Go on even if more memory is needed than there is
    #[arg(long)]
    pub ignore_memory: bool,
}

/// What a run needs at its peak beyond what it holds already, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Need {
    /// Memory of its own.
    pub own: u64,
    /// Files that are mapped: they need addresses, and leave memory again when it is short.
    pub mapped: u64,
}

/// What a thread takes for its stack and what it allocates beside what is counted.
const OF_THREAD: u64 = 3 << 20;

/// The most memory that a run will have held, mapped files included, if it needs so much from now on, in rayon's current
/// pool. What allocators leave unused between allocations is added.
///
/// # Errors
/// When there is less than that, unless the options say to go on; `remedy` tells the way out.
pub fn predict_memory(
    need: Need,
    options: MemoryOptions,
    remedy: &str,
    console: &Console,
) -> anyhow::Result<u64> {
    let process = Process::now();
    let threads = rayon::current_num_threads() as u64;
    let need = Need { own: need.own + need.own / 32 + threads * OF_THREAD, ..need };
    let predicted = peak_rss_bytes().max(process.resident + need.own + need.mapped);
    console.detail(format_args!("{:.2} GB of memory are needed", gigabytes(predicted)));
    let limits = limits(&process);
    if options.ignore_memory {
        return Ok(predicted);
    }
    let tightest = limits.iter().min_by_key(|limit| limit.left.saturating_sub(limit.asked(need)));
    if let Some(limit) = tightest.filter(|limit| limit.asked(need) > limit.left) {
        bail!(
            "this run needs {:.2} GB of memory more than it holds, and {:.2} GB are left ({}); {remedy}, or go on all the \
             same with --ignore-memory",
            gigabytes(limit.asked(need)),
            gigabytes(limit.left),
            limit.by,
        );
    }
    Ok(predicted)
}

/// Has arrays of a few megabytes use the memory of those freed before them, instead of asking the system for pages, which
/// it clears one by one.
///
/// The allocator of glibc maps what is larger than a threshold, which it raises to the size of what was mapped and freed, up
/// to 32 MiB: so that much is mapped and freed at once. No page of it is touched, and other allocators are as they were.
pub fn reuse_freed_memory() {
    const LARGEST_THRESHOLD: usize = 32 << 20;
    const OF_ALLOCATOR: usize = 64 << 10;
    let mut mapped = Vec::<u8>::new();
    // Where there isn't so much, all is as it was.
    if mapped.try_reserve_exact(LARGEST_THRESHOLD - OF_ALLOCATOR).is_ok() {
        drop(black_box(mapped));
    }
}

fn gigabytes(bytes: u64) -> f64 {
    bytes as f64 * 1e-9
}

/// What bounds memory, and what it leaves.
#[derive(Clone, Copy, Debug)]
struct Limit {
    by: &'static str,
    left: u64,
    /// Whether mapped files count.
    counts_mapped: bool,
}

impl Limit {
    fn asked(&self, need: Need) -> u64 {
        need.own + if self.counts_mapped { need.mapped } else { 0 }
    }
}

/// All limits that the system tells. What can't be found out is no limit.
fn limits(process: &Process) -> Vec<Limit> {
    let resource = |resource, by, used: u64, counts_mapped| {
        let (soft, _) = getrlimit(resource).ok()?;
        Some(Limit { by, left: soft.saturating_sub(used), counts_mapped })
    };
    let machine = fs::read_to_string("/proc/meminfo").ok();
    let machine = machine.and_then(|text| kilobytes(&text, "MemAvailable:"));
    [
        machine.map(|left| Limit { by: "what the machine has", left, counts_mapped: false }),
        cgroup_left().map(|left| Limit { by: "the limit of a cgroup", left, counts_mapped: false }),
        resource(Resource::RLIMIT_AS, "the limit of ulimit -v", process.addresses, true),
        resource(Resource::RLIMIT_DATA, "the limit of ulimit -d", process.data, false),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// What the process has now, in bytes.
#[derive(Clone, Copy, Debug)]
struct Process {
    resident: u64,
    addresses: u64,
    data: u64,
}

impl Process {
    fn now() -> Self {
        let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
        let of = |name: &str| kilobytes(&status, name);
        Self {
            resident: of("VmRSS:").unwrap_or_else(peak_rss_bytes),
            addresses: of("VmSize:").unwrap_or(0),
            data: of("VmData:").unwrap_or(0),
        }
    }
}

/// The bytes of a line such as `MemAvailable:  123 kB`.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
    let number: u64 = rest.split_whitespace().next()?.parse().ok()?;
    number.checked_mul(1024)
}

/// What the groups of the process leave, by version 2 of cgroups or 1.
fn cgroup_left() -> Option<u64> {
    let groups = fs::read_to_string("/proc/self/cgroup").ok()?;
    let root = Path::new("/sys/fs/cgroup");
    let left = groups.lines().filter_map(|line| {
        let mut fields = line.splitn(3, ':').skip(1);
        let (controllers, path) = (fields.next()?, fields.next()?.trim_start_matches('/'));
        match controllers {
            "" => left_up_from(root, path, ["memory.max", "memory.current", "inactive_file"]),
            _ if controllers.split(',').any(|name| name == "memory") => {
                let names =
                    ["memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"];
                left_up_from(&root.join("memory"), path, names)
            }
            _ => None,
        }
    });
    left.min()
}

/// The least that a group below `root` and those around it leave. In a container the path may be that of its host: then the
/// root itself is asked.
fn left_up_from(root: &Path, path: &str, names: [&str; 3]) -> Option<u64> {
    let groups = Path::new(path).ancestors().map(|group| root.join(group));
    groups.filter_map(|group| left_in(&group, names)).min()
}

fn left_in(group: &Path, [limit, usage, cache]: [&str; 3]) -> Option<u64> {
    let read = |name: &str| fs::read_to_string(PathBuf::from(group).join(name)).ok();
    // Where there is none, version 1 has the greatest number of pages.
    const NONE: u64 = 1 << 62;
    let limit: u64 = read(limit)?.trim().parse().ok().filter(|&limit| limit < NONE)?;
    let usage: u64 = read(usage)?.trim().parse().ok()?;
    // Files that nobody has used of late leave when memory is short.
    let cached = read("memory.stat").and_then(|stat| {
        let line = stat.lines().find_map(|line| line.strip_prefix(cache)?.strip_prefix(' '))?;
        line.trim().parse::<u64>().ok()
    });
    Some(limit.saturating_sub(usage.saturating_sub(cached.unwrap_or(0))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Common;

    #[test]
    fn what_does_not_fit_is_refused_unless_it_is_ignored() {
        let console = Console::new("test", &Common::default());
        let predict = |own, ignore_memory| {
            let need = Need { own, mapped: 0 };
            predict_memory(need, MemoryOptions { ignore_memory }, "ask for less", &console)
        };
        let small = predict(1 << 20, false).unwrap();
        assert!(small >= 1 << 20);
        // More than any machine has.
        let error = predict(1 << 60, false).unwrap_err().to_string();
        assert!(error.starts_with("this run needs 118895"), "{error}");
        assert!(error.contains("ask for less, or go on all the same with --ignore-memory"));
        assert!(predict(1 << 60, true).unwrap() > 1 << 60);
    }

    #[test]
    fn mapped_files_need_addresses_only() {
        let need = Need { own: 1, mapped: 10 };
        let limit = |counts_mapped| Limit { by: "", left: 5, counts_mapped };
        assert_eq!([true, false].map(|counts| limit(counts).asked(need)), [11, 1]);
    }

    #[test]
    fn groups_leave_what_none_around_them_forbids() {
        let folder = tempfile::tempdir().unwrap();
        let group = |path: &str, limit: &str, usage: u64, cached: u64| {
            let at = folder.path().join(path);
            fs::create_dir_all(&at).unwrap();
            fs::write(at.join("max"), limit).unwrap();
            fs::write(at.join("current"), format!("{usage}\n")).unwrap();
            fs::write(at.join("memory.stat"), format!("anon 1\nfiles {cached}\n")).unwrap();
        };
        let left = |path| left_up_from(folder.path(), path, ["max", "current", "files"]);
        assert_eq!(left("a/b"), None);
        group("a", "1000\n", 600, 100);
        assert_eq!((left("a/b"), left("a")), (Some(500), Some(500)));
        group("a/b", "max\n", 600, 0);
        assert_eq!(left("a/b"), Some(500));
        group("a/b", "700\n", 600, 0);
        assert_eq!((left("a/b"), left("elsewhere")), (Some(100), None));
        group("a/b", "500\n", 600, 0);
        assert_eq!(left("a/b"), Some(0));
    }

    #[test]
    fn lines_of_the_system_are_read() {
        let text = "MemTotal:  99 kB\nMemAvailable:   12 kB\n";
        assert_eq!(kilobytes(text, "MemAvailable:"), Some(12 << 10));
        assert_eq!(kilobytes(text, "VmRSS:"), None);
        let process = Process::now();
        assert!(process.resident > 0 && process.resident <= process.addresses);
    }
}
