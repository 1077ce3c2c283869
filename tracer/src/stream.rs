//! Random streams that belong to a grain and a step, not to a thread or to the order of work.

use rand_core::{Infallible, TryRng};

/// What a stream is for, so that a start and a step of the same grain never share numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Where a grain starts and how fast.
    Start = 1,
    /// The kicks of the gas during a step.
    Noise = 2,
    /// The points of a study that draws samples; the "grain" is the varied key.
    Sample = 3,
}

/// The stream of random numbers of one grain at one step: a counter-based generator, so that any of 2^128 streams begins
/// at once, without a state to carry from step to step.
///
/// Philox 4x64 with 10 rounds. The key is the seed; the counter holds block, step, grain and purpose.
///
/// Source: Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11 (2011). Checked against
/// the authors' known answers by `philox_gives_the_known_answers`.
///
/// *Why not a ChaCha stream:* Philox needs no key schedule for each grain and step and is ten lines; its statistics
/// passed the full BigCrush in the paper.
#[derive(Clone, Debug)]
pub struct Stream {
    key: [u64; 2],
    counter: [u64; 4],
    block: [u64; 4],
    used: usize,
}

impl Stream {
    /// The stream of a grain (its id) at a step, under a seed.
    pub fn new(seed: u64, purpose: Purpose, grain: u64, step: u64) -> Self {
        Self { key: [seed, 0], counter: [0, step, grain, purpose as u64], block: [0; 4], used: 4 }
    }

    /// A number in [0, 1), a multiple of 2^-53.
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn next(&mut self) -> u64 {
        if self.used == 4 {
            self.block = philox(self.counter, self.key);
            self.counter[0] = self.counter[0].wrapping_add(1);
            self.used = 0;
        }
        self.used += 1;
        self.block[self.used - 1]
    }
}

/// Philox 4x64-10.
fn philox(mut x: [u64; 4], mut key: [u64; 2]) -> [u64; 4] {
    // Multipliers and key increments of the paper (the increments: golden ratio, sqrt(3) - 1).
    const M: [u64; 2] = [0xD2E7_470E_E14C_6C93, 0xCA5A_8263_9512_1157];
    const W: [u64; 2] = [0x9E37_79B9_7F4A_7C15, 0xBB67_AE85_84CA_A73B];
    for round in 0..10 {
        if round > 0 {
            key = [key[0].wrapping_add(W[0]), key[1].wrapping_add(W[1])];
        }
        let (a, b) = (u128::from(M[0]) * u128::from(x[0]), u128::from(M[1]) * u128::from(x[2]));
        x = [(b >> 64) as u64 ^ x[1] ^ key[0], b as u64, (a >> 64) as u64 ^ x[3] ^ key[1], a as u64];
    }
    x
}

impl TryRng for Stream {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        Ok((self.next() >> 32) as u32)
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        Ok(self.next())
    }

    fn try_fill_bytes(&mut self, bytes: &mut [u8]) -> Result<(), Infallible> {
        for chunk in bytes.chunks_mut(8) {
            chunk.copy_from_slice(&self.next().to_le_bytes()[..chunk.len()]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn philox_gives_the_known_answers() {
        // From the authors' file of known answers (philox4x64 10): zeros, ones, digits of pi.
        for (counter, key, answer) in [
            ([0; 4], [0; 2], [0x16554d9eca36314c, 0xdb20fe9d672d0fdc, 0xd7e772cee186176b, 0x7e68b68aec7ba23b]),
            (
                [u64::MAX; 4],
                [u64::MAX; 2],
                [0x87b092c3013fe90b, 0x438c3c67be8d0224, 0x9cc7d7c69cd777b6, 0xa09caebf594f0ba0],
            ),
            (
                [0x243f6a8885a308d3, 0x13198a2e03707344, 0xa4093822299f31d0, 0x082efa98ec4e6c89],
                [0x452821e638d01377, 0xbe5466cf34e90c6c],
                [0xa528f45403e61d95, 0x38c72dbd566e9788, 0xa5a1610e72fd18b5, 0x57bd43b5e52b7fe6],
            ),
        ] {
            assert_eq!(philox(counter, key), answer);
        }
    }

    #[test]
    fn streams_differ_by_every_part_of_their_name() {
        let first = |s: u64, p, g, n| Stream::new(s, p, g, n).unit();
        let mut seen = vec![
            first(1, Purpose::Start, 1, 1),
            first(2, Purpose::Start, 1, 1),
            first(1, Purpose::Noise, 1, 1),
            first(1, Purpose::Start, 2, 1),
            first(1, Purpose::Start, 1, 2),
        ];
        seen.sort_by(f64::total_cmp);
        seen.dedup();
        assert_eq!(seen.len(), 5);
    }
}
