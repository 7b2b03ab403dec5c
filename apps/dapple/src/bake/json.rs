//! Objects of a JSON document of which only what is edited changes: the rest stays as it is written, byte for byte.

use std::fmt;

use anyhow::{Context, Result};
use serde::de::{DeserializeOwned, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::value::{RawValue, to_raw_value};

/// A value as it is written.
pub(crate) type Raw = Box<RawValue>;

/// An object: its members in order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Object(Vec<(String, Raw)>);

impl Object {
    /// Reads an object, whose values are not looked at.
    pub(crate) fn parse(raw: &RawValue) -> Result<Object> {
        serde_json::from_str(raw.get()).context("an object was expected")
    }

    pub(crate) fn get(&self, key: &str) -> Option<&RawValue> {
        self.0.iter().find(|(k, _)| k == key).map(|(_, value)| value.as_ref())
    }

    pub(crate) fn has(&self, key: &str) -> bool {
        self.get(key).is_some()
    }

    /// A member's value, if it is there.
    pub(crate) fn read<T: DeserializeOwned>(&self, key: &str) -> Result<Option<T>> {
        self.get(key)
            .map(|raw| serde_json::from_str(raw.get()).with_context(|| format!("'{key}'")))
            .transpose()
    }

    /// A whole number, such as an index or a count; `1.0` is 1.
    pub(crate) fn whole(&self, key: &str) -> Result<Option<usize>> {
        let Some(number) = self.read::<f64>(key)? else { return Ok(None) };
        // 2⁵³: beyond, whole numbers are not exact.
        if !(0.0..=9_007_199_254_740_992.0).contains(&number) || number.fract() != 0.0 {
            anyhow::bail!("'{key}' is {number}, but must be a whole number");
        }
        Ok(Some(number as usize))
    }

    /// An object inside; empty if there is none.
    pub(crate) fn object(&self, key: &str) -> Result<Object> {
        self.get(key)
            .map_or(Ok(Object::default()), |raw| Object::parse(raw).with_context(|| format!("'{key}'")))
    }

    /// A list inside; empty if there is none.
    pub(crate) fn list(&self, key: &str) -> Result<Vec<Raw>> {
        Ok(self.read(key)?.unwrap_or_default())
    }

    /// Sets a member, in its place if it is there.
    pub(crate) fn set(&mut self, key: &str, value: &(impl Serialize + ?Sized)) -> Result<()> {
        let raw = to_raw_value(value).with_context(|| format!("'{key}' cannot be written"))?;
        match self.0.iter_mut().find(|(k, _)| k == key) {
            Some((_, old)) => *old = raw,
            None => self.0.push((key.to_owned(), raw)),
        }
        Ok(())
    }

    pub(crate) fn remove(&mut self, key: &str) {
        self.0.retain(|(k, _)| k != key);
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn keys(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|(key, _)| key.as_str())
    }

    /// As a value for a list.
    pub(crate) fn to_raw(&self) -> Result<Raw> {
        Ok(to_raw_value(self)?)
    }
}

impl Serialize for Object {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(key, value)| (key, value)))
    }
}

impl<'de> Deserialize<'de> for Object {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Members;

        impl<'de> Visitor<'de> for Members {
            type Value = Object;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Object, A::Error> {
                let mut members = Vec::new();
                while let Some(member) = map.next_entry()? {
                    members.push(member);
                }
                Ok(Object(members))
            }
        }

        deserializer.deserialize_map(Members)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_edited_stays_as_it_is_written() {
        let text = r#"{"z":1.0e+2 , "a" : [ 0.1000000000000000055511, 12345678901234567890123 ],"é":"\u00e9","n":null}"#;
        let mut object: Object = serde_json::from_str(text).unwrap();
        assert_eq!(object.whole("z").unwrap(), Some(100));
        assert!(object.whole("a").is_err() && object.whole("absent").unwrap().is_none());
        object.set("b", &[1, 2]).unwrap();
        object.set("n", &false).unwrap();
        object.remove("z");
        let expected =
            r#"{"a":[ 0.1000000000000000055511, 12345678901234567890123 ],"é":"\u00e9","n":false,"b":[1,2]}"#;
        assert_eq!(serde_json::to_string(&object).unwrap(), expected);
    }
}
