//! Binary numbers of all types that the formats know.

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Number {
    /// Bytes of one number.
    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// The number in the first [`Number::size`] bytes; bytes that are missing count as 0.
    pub fn decode(self, bytes: &[u8], big: bool) -> f64 {
        let size = self.size();
        let mut b = [0u8; 8];
        for (slot, &byte) in b[..size].iter_mut().zip(bytes) {
            *slot = byte;
        }
        if big {
            b[..size].reverse();
        }
        let word = u64::from_le_bytes(b);
        match self {
            Self::I8 => f64::from(word as i8),
            Self::U8 => f64::from(word as u8),
            Self::I16 => f64::from(word as i16),
            Self::U16 => f64::from(word as u16),
            Self::I32 => f64::from(word as i32),
            Self::U32 => f64::from(word as u32),
            Self::I64 => word as i64 as f64,
            Self::U64 => word as f64,
            Self::F32 => f64::from(f32::from_bits(word as u32)),
            Self::F64 => f64::from_bits(word),
        }
    }

    /// All whole numbers in `bytes`.
    pub fn decode_all(self, bytes: &[u8], big: bool) -> impl Iterator<Item = f64> {
        bytes
            .chunks_exact(self.size())
            .map(move |b| self.decode(b, big))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_orders_and_signs_of_all_types() {
        let ends = [
            (Number::I8, -128.0),
            (Number::U8, 128.0),
            (Number::I16, -32768.0),
            (Number::U16, 32768.0),
            (Number::I32, -2147483648.0),
            (Number::U32, 2147483648.0),
            (Number::I64, -9223372036854775808.0),
            (Number::U64, 9223372036854775808.0),
        ];
        for (kind, value) in ends {
            let mut bytes = vec![0; kind.size()];
            bytes[0] = 0x80;
            assert_eq!(kind.decode(&bytes, true), value, "{kind:?}");
            bytes.reverse();
            assert_eq!(kind.decode(&bytes, false), value, "{kind:?}");
        }
        let quarters: Vec<u8> = [0.25f32, -1.5]
            .iter()
            .flat_map(|x| x.to_be_bytes())
            .collect();
        let all: Vec<f64> = Number::F32.decode_all(&quarters, true).collect();
        assert_eq!(all, [0.25, -1.5]);
        assert_eq!(Number::F64.decode(&0.1f64.to_le_bytes(), false), 0.1);
    }
}
