//! The key that host and drives share, from a file.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::time::{SystemTime, UNIX_EPOCH};

use protocol::authentic::{KEY_BYTES, Key};

use crate::failure::Failure;

/// No key file is longer [bytes].
const MOST_BYTES: u64 = 256;

/// Reads a key: 32 hexadecimal digits, or 16 bytes.
///
/// # Errors
/// There is no such file, or no key in it.
pub(crate) fn load(path: &Path) -> Result<Key, Failure> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(MOST_BYTES).read_to_end(&mut bytes))
        .map_err(|e| Failure::unreadable(path, &e))?;
    let raw = <[u8; KEY_BYTES]>::try_from(bytes.as_slice()).ok().map(Key::new);
    raw.or_else(|| Key::from_hex(bytes.trim_ascii())).ok_or_else(|| {
        Failure::input("this is no key").in_file(path).with_help(
            "A key is 32 hexadecimal digits, or 16 bytes: `openssl rand -hex 16 > drives.key` makes one.",
        )
    })
}

/// The key of the command line, if it names one.
///
/// # Errors
/// As [`load`].
pub(crate) fn of(path: Option<&Path>) -> Result<Option<Key>, Failure> {
    path.map(load).transpose()
}

/// Time that only a clock set back makes smaller: hosts that come later have greater counters [us].
pub(crate) fn now_us() -> u64 {
    SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |since| u64::try_from(since.as_micros()).unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_digits_or_bytes_and_nothing_else() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("a.key");
        let read = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            load(&path)
        };
        let key = Key::new([0xab; KEY_BYTES]);
        assert_eq!(read(&[0xab; KEY_BYTES]).unwrap(), key);
        assert_eq!(read(b"abababababababababababababababab\n").unwrap(), key);
        for wrong in [&b""[..], b"ababab", b"abababababababababababababababax", &[7; 300]] {
            assert!(read(wrong).unwrap_err().to_string().contains("no key"));
        }
        assert!(load(&home.path().join("none")).is_err());
    }
}
