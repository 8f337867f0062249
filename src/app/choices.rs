//! What a person chooses from a list: enums whose values have a name and a sentence of help, declared as a table.

/// Declares such an enum: its values in the order shown, each as variant, name, what it is.
macro_rules! choices {
    ($(#[$meta:meta])* $name:ident { $($variant:ident, $text:literal, $help:literal;)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
        pub enum $name { $(#[doc = $help] $variant,)* }

        impl $name {
            /// All, in the order shown.
            pub const ALL: [Self; [$($text),*].len()] = [$(Self::$variant),*];

            /// The name shown.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }

            /// What it is, in a sentence.
            pub fn help(self) -> &'static str {
                match self { $(Self::$variant => $help,)* }
            }

            /// The next in order; the first after the last.
            pub fn next(self) -> Self {
                Self::ALL[(self as usize + 1) % Self::ALL.len()]
            }
        }

        impl $crate::app::controls::Choice for $name {
            const ALL: &'static [Self] = &Self::ALL;

            fn name_and_help(self) -> (&'static str, &'static str) {
                (self.name(), self.help())
            }
        }
    };
}

pub(crate) use choices;
