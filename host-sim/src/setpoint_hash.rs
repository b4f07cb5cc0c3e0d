//! A fingerprint of everything the drives were told to do.

use protocol::checksum::Fnv64;

/// FNV-1a (64 bit) over the set-points of a job, in order of tick and then axis.
///
/// Each set-point contributes its tick since the start of its table (u64), axis (u8), position (i64), and the bits
/// of velocity and acceleration (u32 each), little-endian. Waits between tables do not count: the hash depends on
/// the tables and the drives' arithmetic alone, not on the speed of the bus or on threads.
#[derive(Clone, Copy, Debug, Default)]
pub struct SetpointHash {
    hash: Fnv64,
    count: u64,
}

impl SetpointHash {
    /// Takes in one set-point.
    pub fn add(&mut self, tick: u64, axis: u8, position: i64, velocity: f32, acceleration: f32) {
        self.hash = self
            .hash
            .with(&tick.to_le_bytes())
            .with(&[axis])
            .with(&position.to_le_bytes())
            .with(&velocity.to_bits().to_le_bytes())
            .with(&acceleration.to_bits().to_le_bytes());
        self.count += 1;
    }

    /// How many set-points there were.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The hash.
    pub fn value(&self) -> u64 {
        self.hash.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_counts() {
        let hash = |t, a, p, v: f32, c: f32| {
            let mut h = SetpointHash::default();
            h.add(t, a, p, v, c);
            h.value()
        };
        let base = hash(1, 2, 3, 4.0, 0.0);
        for other in [
            hash(2, 2, 3, 4.0, 0.0),
            hash(1, 3, 3, 4.0, 0.0),
            hash(1, 2, -3, 4.0, 0.0),
            hash(1, 2, 3, 4.5, 0.0),
            hash(1, 2, 3, 4.0, -0.0),
        ] {
            assert_ne!(base, other);
        }
    }

    #[test]
    fn it_is_fnv_1a_of_the_bytes() {
        // The published offset basis and prime of the 64-bit FNV-1a, over 25 zero bytes.
        let mut h = SetpointHash::default();
        h.add(0, 0, 0, 0.0, 0.0);
        let expected =
            (0..25).fold(0xcbf2_9ce4_8422_2325u64, |hash, _| hash.wrapping_mul(0x0000_0100_0000_01b3));
        assert_eq!(h.value(), expected);
    }
}
