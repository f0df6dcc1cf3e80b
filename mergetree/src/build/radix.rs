//! Sorting by a 32-bit key in linear time.

/// Sorts pairs by their key, ascending; equal keys keep their order. Keys of finite floats that are not negative sort
/// like the floats when given as [`f32::to_bits`].
///
/// Least significant digit first, three passes of eleven bits.
///
/// # Complexity
/// Time linear in the number of pairs; as much memory again as they take.
pub(crate) fn sort_by_key(pairs: &mut Vec<(u32, u32)>) {
    const BITS: u32 = 11;
    const BINS: usize = 1 << BITS;
    let mut scratch = vec![(0, 0); pairs.len()];
    for pass in 0..3 {
        let digit = |key: u32| (key >> (pass * BITS)) as usize & (BINS - 1);
        let mut offsets = [0u32; BINS];
        for &(key, _) in pairs.iter() {
            offsets[digit(key)] += 1;
        }
        if offsets.iter().any(|&count| count as usize == pairs.len()) {
            continue;
        }
        let mut sum = 0;
        for offset in &mut offsets {
            sum += std::mem::replace(offset, sum);
        }
        for &pair in pairs.iter() {
            let offset = &mut offsets[digit(pair.0)];
            scratch[*offset as usize] = pair;
            *offset += 1;
        }
        std::mem::swap(pairs, &mut scratch);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn sorts_like_a_stable_sort(keys in prop::collection::vec(prop_oneof![any::<u32>(), 0u32..5], 0..300)) {
            let mut pairs: Vec<(u32, u32)> = keys.iter().copied().zip(0..).collect();
            let mut expected = pairs.clone();
            expected.sort_by_key(|p| p.0);
            sort_by_key(&mut pairs);
            prop_assert_eq!(pairs, expected);
        }

        #[test]
        fn orders_floats_by_their_bits(values in prop::collection::vec(0.0f32..1e30, 0..100)) {
            let mut pairs: Vec<(u32, u32)> = values.iter().map(|v| v.to_bits()).zip(0..).collect();
            sort_by_key(&mut pairs);
            prop_assert!(pairs.windows(2).all(|w| values[w[0].1 as usize] <= values[w[1].1 as usize]));
        }
    }
}
