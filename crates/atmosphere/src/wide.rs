//! Functions compiled twice: once for any machine and once for the vectors of AVX2, which is chosen where the machine has
//! them. Neither fuses a product with a sum, so that both give the same bits.

/// Defines such a function. What it calls is compiled with it as far as it is inlined.
macro_rules! wide_too {
    ($(#[$doc:meta])* $vis:vis fn $name:ident($($argument:ident: $type:ty),* $(,)?) $(-> $out:ty)? $body:block) => {
        $(#[$doc])*
        $vis fn $name($($argument: $type),*) $(-> $out)? {
            #[inline(always)]
            fn any($($argument: $type),*) $(-> $out)? $body
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn wide($($argument: $type),*) $(-> $out)? {
                    any($($argument),*)
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    // SAFETY: the machine has just been found to have what the function is compiled for.
                    return unsafe { wide($($argument),*) };
                }
            }
            any($($argument),*)
        }
    };
}
pub(crate) use wide_too;

/// eˣ to within two units in the last place, and 0 where it would be less than e⁻⁷⁰⁰; without a branch, so that several are
/// computed side by side: 2ⁿ eʳ, |r| ≤ ½ ln 2, eʳ by its power series.
#[inline(always)]
pub(crate) fn exp(x: f64) -> f64 {
    /// To which a number is added to be rounded to a whole one, in the lowest bits.
    const ROUNDS: f64 = 1.5 * (1u64 << 52) as f64;
    // ln 2 in two parts, the first with so few bits that its multiples are exact.
    const LN_2: [f64; 2] = [f64::from_bits(0x3fe6_2e42_fee0_0000), f64::from_bits(0x3dea_39ef_3579_3c76)];
    const SERIES: [f64; 13] = {
        let mut values = [1.0; 13];
        let mut k = 1;
        while k < 13 {
            values[k] = values[k - 1] / (k + 1) as f64;
            k += 1;
        }
        values
    };
    let within = x.clamp(-708.0, 708.0);
    let rounded = within * std::f64::consts::LOG2_E + ROUNDS;
    let n = rounded - ROUNDS;
    let r = (within - n * LN_2[0]) - n * LN_2[1];
    let mut sum = SERIES[12];
    let mut k = 12;
    while k > 0 {
        k -= 1;
        sum = sum * r + SERIES[k];
    }
    let power = f64::from_bits((rounded.to_bits() << 52).wrapping_add(1023 << 52));
    if x < -700.0 { 0.0 } else { power + power * (sum * r) }
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_exponential_is_that_of_the_library() {
        let mut x = -699.9;
        while x < 700.0 {
            let (found, due) = (super::exp(x), f64::exp(x));
            assert!((found / due - 1.0).abs() < 5e-16, "{x}: {found:e} {due:e}");
            x += 0.173;
        }
        assert_eq!([super::exp(0.0), super::exp(-701.0), super::exp(f64::NEG_INFINITY)], [1.0, 0.0, 0.0]);
        assert!(super::exp(f64::NAN).is_nan());
    }
}
