//! Peak memory of this process.

/// Largest resident memory so far [MiB]; `None` where the system does not tell.
pub fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kib / 1024.0)
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    #[test]
    fn peak_follows_an_allocation() {
        let before = super::peak_memory_mib().unwrap();
        let block = vec![1u8; 64 << 20];
        let after = super::peak_memory_mib().unwrap();
        assert!(after >= before && after >= 60.0, "{before} {after} {}", block[block.len() / 2]);
    }
}
