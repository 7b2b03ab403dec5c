//! Who may do what.

use crate::{Reason, Refusal, Role};

/// Tokens and what they allow.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Access {
    tokens: Vec<(String, Role)>,
}

impl std::fmt::Debug for Access {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Tokens are secrets: they stay out of logs.
        let roles: Vec<Role> = self.tokens.iter().map(|(_, role)| *role).collect();
        f.debug_struct("Access").field("tokens_for", &roles).finish()
    }
}

impl Access {
    /// Whoever has one of these tokens has its role. Without a token one may view, unless there are tokens for that; without any tokens at all
    /// everyone may do everything.
    pub fn new(tokens: Vec<(String, Role)>) -> Access {
        Access { tokens }
    }

    /// What one may do who has no token; `None` for nothing.
    pub fn open_role(&self) -> Option<Role> {
        if self.tokens.is_empty() {
            return Some(Role::Interact);
        }
        self.tokens.iter().all(|(_, role)| *role != Role::View).then_some(Role::View)
    }

    /// Whether this is one of the tokens.
    pub fn knows(&self, token: Option<&str>) -> bool {
        token.is_some_and(|token| self.tokens.iter().any(|(known, _)| equal(known, token)))
    }

    pub(super) fn role(&self, token: Option<&str>) -> Result<Role, Refusal> {
        let refusal = |message: &str| Refusal::new(Reason::Token, message);
        if self.tokens.is_empty() {
            return Ok(Role::Interact);
        }
        let Some(token) = token else {
            return self
                .open_role()
                .ok_or_else(|| refusal("this host asks for a token: add ?token=… to its address"));
        };
        let roles = self.tokens.iter().filter(|(known, _)| equal(known, token)).map(|(_, role)| *role);
        roles.max().ok_or_else(|| refusal("the token is not one of this host's"))
    }
}

/// Whether two secrets are equal, in a time that does not tell where they differ.
pub(super) fn equal(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_give_roles() {
        let role =
            |access: &Access, token: Option<&str>| access.role(token).map_err(|refusal| refusal.reason);
        let open = Access::default();
        assert_eq!(role(&open, None), Ok(Role::Interact));
        assert_eq!(role(&open, Some("anything")), Ok(Role::Interact));
        let guarded = Access::new(vec![("look".into(), Role::View), ("touch".into(), Role::Interact)]);
        assert_eq!(role(&guarded, None), Err(Reason::Token));
        assert_eq!(role(&guarded, Some("look")), Ok(Role::View));
        assert_eq!(role(&guarded, Some("touch")), Ok(Role::Interact));
        assert_eq!(role(&guarded, Some("touch ")), Err(Reason::Token));
        let public = Access::new(vec![("touch".into(), Role::Interact)]);
        assert_eq!(role(&public, None), Ok(Role::View));
        assert_eq!(role(&public, Some("")), Err(Reason::Token));
        assert!(!format!("{guarded:?}").contains("touch"));
    }
}
