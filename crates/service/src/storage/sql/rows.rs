//! Rows as structs.

/// Declares a struct that is read from the columns of its fields' names. As sqlx's derive does; but sqlx's macros build
/// SQLite a second time, for the compiler.
macro_rules! row {
    ($(#[$about:meta])* $visible:vis struct $name:ident { $($field:ident: $kind:ty,)* }) => {
        $(#[$about])*
        $visible struct $name {
            $($field: $kind,)*
        }

        impl<'r> sqlx::FromRow<'r, super::DatabaseRow> for $name {
            fn from_row(row: &'r super::DatabaseRow) -> Result<Self, sqlx::Error> {
                Ok($name { $($field: sqlx::Row::try_get(row, stringify!($field))?,)* })
            }
        }
    };
}
pub(super) use row;
