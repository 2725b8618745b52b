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
