//! What a server does: one that is alone does all, of several each may have its part.

use visage_geometry::names::UnknownName;

/// A part of what there is to do.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, strum::VariantArray, strum::IntoStaticStr, strum::EnumString, strum::Display,
)]
#[strum(serialize_all = "lowercase", parse_err_ty = UnknownName, parse_err_fn = no_role)]
pub enum Role {
    /// Answers requests.
    Api,
    /// Runs jobs.
    Worker,
    /// Searches the gallery: for itself if it answers requests, and for others that leave that.
    Search,
}

impl Role {
    /// All of them.
    pub const ALL: &[Role] = <Role as strum::VariantArray>::VARIANTS;

    /// Its name, as an argument.
    pub fn name(self) -> &'static str {
        self.into()
    }
}

fn no_role(text: &str) -> UnknownName {
    UnknownName::of::<Role>("role", text)
}

/// The roles of a server: at least one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Roles {
    /// Whether it answers requests; else it tells how it is, and nothing else.
    pub api: bool,
    /// Whether it runs jobs.
    pub worker: bool,
    /// Whether it has the index: all of it if it answers requests, else a part.
    pub search: bool,
}

impl Default for Roles {
    fn default() -> Self {
        Roles { api: true, worker: true, search: true }
    }
}

impl Roles {
    /// These; all if there are none.
    pub fn of(roles: &[Role]) -> Roles {
        match roles {
            [] => Roles::default(),
            roles => {
                let has = |role| roles.contains(&role);
                Roles { api: has(Role::Api), worker: has(Role::Worker), search: has(Role::Search) }
            }
        }
    }

    /// Which they are.
    pub fn list(self) -> impl Iterator<Item = Role> {
        let has = move |role: &Role| match role {
            Role::Api => self.api,
            Role::Worker => self.worker,
            Role::Search => self.search,
        };
        Role::ALL.iter().copied().filter(has)
    }

    /// Whether nothing is left to others.
    pub fn are_all(self) -> bool {
        self == Roles::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roles_are_known_by_their_names_and_others_are_refused_with_what_there_is() {
        for &role in Role::ALL {
            assert_eq!(role.to_string().parse(), Ok(role));
            assert_eq!(Roles::of(&[role]).list().collect::<Vec<_>>(), [role]);
        }
        let refused = "searcher".parse::<Role>().expect_err("unknown").to_string();
        assert!(
            refused.contains("searcher") && Role::ALL.iter().all(|role| refused.contains(role.name())),
            "{refused}"
        );
        assert!(Roles::of(&[]).are_all() && !Roles::of(&[Role::Api]).are_all());
    }
}
