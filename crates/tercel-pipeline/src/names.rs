//! The names of objects, as numbers.

use std::collections::HashMap;
use std::sync::Arc;

use tercel_core::filter::Identity;

/// Every identity that came in, with a number of its own.
#[derive(Debug, Clone, Default)]
pub(crate) struct Names {
    numbers: HashMap<Arc<str>, Identity>,
    names: Vec<Arc<str>>,
}

impl Names {
    /// The number of a name.
    pub fn number(&mut self, name: &Arc<str>) -> Identity {
        if let Some(identity) = self.numbers.get(name) {
            return *identity;
        }
        let identity = Identity(u32::try_from(self.names.len()).unwrap_or(u32::MAX));
        self.names.push(Arc::clone(name));
        self.numbers.insert(Arc::clone(name), identity);
        identity
    }

    /// The name behind a number.
    pub fn name(&self, identity: Identity) -> Option<&Arc<str>> {
        self.names.get(identity.0 as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_keeps_its_number() {
        let mut names = Names::default();
        let (a, b) = (names.number(&"219000101".into()), names.number(&"219000102".into()));
        assert_ne!(a, b);
        assert_eq!(names.number(&"219000101".into()), a);
        assert_eq!(names.name(b).map(|name| &**name), Some("219000102"));
    }
}
