//! The constants of a stage, as one struct that stands where they are used: name, unit, value, and where it comes from.
//!
//! They are constants of the program. With the feature `vary`, which only `examples/tuning.rs` turns on, one of them is multiplied by
//! a factor: that example shows how much results depend on each, and which could be removed.

/// Defines the constants of a file: `tuning! { const TUNING: Tuning { /// What it means, its unit. name: f64 = 1.0, } }`.
#[cfg(not(feature = "vary"))]
#[macro_export]
macro_rules! tuning {
    ($(#[$meta:meta])* $vis:vis const $tuning:ident: $type:ident {
        $($(#[$about:meta])* $name:ident: $of:ty = $value:expr,)*
    }) => {
        $(#[$meta])*
        $vis struct $type { $($(#[$about])* $vis $name: $of,)* }

        $vis const $tuning: $type = $type { $($name: $value,)* };
    };
}

/// Defines the constants of a file, each as the table of [`vary`](crate::tuning::vary) has it.
#[cfg(feature = "vary")]
#[macro_export]
macro_rules! tuning {
    ($(#[$meta:meta])* $vis:vis const $tuning:ident: $type:ident {
        $($(#[$about:meta])* $name:ident: $of:ty = $value:expr,)*
    }) => {
        $(#[$meta])*
        $vis struct $type { $($(#[$about])* $vis $name: $of,)* }

        $vis static $tuning: ::std::sync::LazyLock<$type> = ::std::sync::LazyLock::new(|| $type {
            $($name: $crate::tuning::varied(concat!(module_path!(), "::", stringify!($name)), $value),)*
        });
    };
}

#[cfg(feature = "vary")]
pub use self::varying::{used, varied, vary};

#[cfg(feature = "vary")]
mod varying {
    use std::collections::BTreeSet;
    use std::sync::{Mutex, OnceLock, PoisonError};

    static VARIED: OnceLock<(String, f64)> = OnceLock::new();
    static USED: Mutex<BTreeSet<&str>> = Mutex::new(BTreeSet::new());

    /// A number that can be taken times a factor.
    pub trait Scale {
        /// This one times `factor`; whole numbers are rounded.
        fn scaled(self, factor: f64) -> Self;
    }

    macro_rules! whole_numbers {
        ($($number:ty)*) => { $(impl Scale for $number {
            fn scaled(self, factor: f64) -> Self {
                (self as f64 * factor).round() as $number
            }
        })* };
    }
    whole_numbers!(u8 u16 u32 u64 usize i32);

    impl Scale for f32 {
        fn scaled(self, factor: f64) -> Self {
            self * factor as f32
        }
    }

    impl Scale for f64 {
        fn scaled(self, factor: f64) -> Self {
            self * factor
        }
    }

    impl<T: Scale, const N: usize> Scale for [T; N] {
        fn scaled(self, factor: f64) -> Self {
            self.map(|number| number.scaled(factor))
        }
    }

    /// From now on the constant of this name is taken times `factor`. Once a process, before anything is computed.
    pub fn vary(name: &str, factor: f64) {
        VARIED.get_or_init(|| (name.to_owned(), factor));
    }

    /// The names of the constants that were used so far.
    pub fn used() -> Vec<&'static str> {
        USED.lock().unwrap_or_else(PoisonError::into_inner).iter().copied().collect()
    }

    /// The value of a constant; for [`tuning!`](crate::tuning!).
    pub fn varied<T: Scale>(name: &'static str, value: T) -> T {
        USED.lock().unwrap_or_else(PoisonError::into_inner).insert(name);
        match VARIED.get() {
            Some((varied, factor)) if varied == name => value.scaled(*factor),
            _ => value,
        }
    }
}

#[cfg(test)]
mod tests {
    tuning! {
        /// Constants of a stage that is none.
        const TUNING: Tuning {
            /// A length, in spacings,
            length: f64 = 2.5,
            /// and several.
            lengths: [f32; 2] = [1.0, 0.5],
        }
    }

    #[test]
    fn constants_have_their_values_unless_they_are_varied() {
        assert_eq!((TUNING.length, TUNING.lengths), (2.5, [1.0, 0.5]));
    }
}
