//! What this process uses, as Linux tells it; nothing elsewhere.

use std::fs::{read_dir, read_to_string};

/// Ticks of `/proc/self/stat` a second: fixed on Linux, whatever the kernel runs at.
const TICKS_HZ: f64 = 100.0;

/// Memory in RAM, bytes.
pub fn resident_bytes() -> Option<f64> {
    let status = read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<f64>().ok().map(|kilobytes| kilobytes * 1024.0)
}

/// Seconds of all cores spent in this process.
pub fn cpu_s() -> Option<f64> {
    let stat = read_to_string("/proc/self/stat").ok()?;
    // The name in brackets may hold blanks.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |i: usize| fields.get(i)?.parse::<f64>().ok();
    Some((ticks(11)? + ticks(12)?) / TICKS_HZ)
}

/// Threads and open files.
pub fn threads_and_files() -> Option<(usize, usize)> {
    Some((read_dir("/proc/self/task").ok()?.count(), read_dir("/proc/self/fd").ok()?.count()))
}
