//! Typed access to the JSON tree with errors that name the place.

use serde_json::{Map, Value};

use crate::load::LoadError;
use crate::load::context::{Context, is_usable};

/// A JSON object that knows where in the file it is.
pub(super) struct Object<'a> {
    pub(super) context: &'a Context<'a>,
    map: &'a Map<String, Value>,
    /// For messages: `mesh 3 "column"`, `mesh 3 "column".primitives[0]`.
    pub(super) at: String,
}

impl<'a> Object<'a> {
    pub(super) fn new(context: &'a Context<'a>, value: &'a Value, at: String) -> Result<Self, LoadError> {
        match value {
            Value::Object(map) => Ok(Object { context, map, at }),
            _ => Err(wrong_type(context, at, "an object", value)),
        }
    }

    /// The place of a property, for messages.
    pub(super) fn at_key(&self, key: &str) -> String {
        if self.at.is_empty() { key.to_owned() } else { format!("{}.{key}", self.at) }
    }

    fn wrong_type(&self, key: &str, expected: &'static str, found: &Value) -> LoadError {
        wrong_type(self.context, self.at_key(key), expected, found)
    }

    pub(super) fn missing(&self, property: &'static str) -> LoadError {
        LoadError::Missing { file: self.context.file(), at: self.at.clone(), property }
    }

    pub(super) fn invalid(&self, problem: impl Into<String>) -> LoadError {
        self.context.invalid(self.at.clone(), problem)
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.map.contains_key(key)
    }

    /// Application-specific data, of any shape.
    pub(super) fn extras(&self) -> Option<&'a Value> {
        self.map.get("extras")
    }

    pub(super) fn object(&self, key: &str) -> Result<Option<Object<'a>>, LoadError> {
        self.map.get(key).map(|value| Object::new(self.context, value, self.at_key(key))).transpose()
    }

    /// The extension `name` of this object.
    pub(super) fn extension(&self, name: &str) -> Result<Option<Object<'a>>, LoadError> {
        match self.object("extensions")? {
            Some(extensions) => extensions.object(name),
            None => Ok(None),
        }
    }

    pub(super) fn array(&self, key: &str) -> Result<&'a [Value], LoadError> {
        match self.map.get(key) {
            None => Ok(&[]),
            Some(Value::Array(values)) => Ok(values),
            Some(value) => Err(self.wrong_type(key, "a list", value)),
        }
    }

    /// A list of objects, each named by the key and its index.
    pub(super) fn objects(&self, key: &str) -> Result<Vec<Object<'a>>, LoadError> {
        let item = |(i, value)| Object::new(self.context, value, format!("{}[{i}]", self.at_key(key)));
        self.array(key)?.iter().enumerate().map(item).collect()
    }

    /// A top-level list of objects, each called `kind index "name"`.
    pub(super) fn entities(&self, key: &str, kind: &str) -> Result<Vec<Object<'a>>, LoadError> {
        let item = |(i, value): (usize, &'a Value)| {
            let at = match value.get("name").and_then(Value::as_str) {
                Some(name) => format!("{kind} {i} \"{}\"", name.chars().take(60).collect::<String>()),
                None => format!("{kind} {i}"),
            };
            Object::new(self.context, value, at)
        };
        self.array(key)?.iter().enumerate().map(item).collect()
    }

    pub(super) fn string(&self, key: &str) -> Result<Option<&'a str>, LoadError> {
        match self.map.get(key) {
            None => Ok(None),
            Some(Value::String(s)) => Ok(Some(s)),
            Some(value) => Err(self.wrong_type(key, "a string", value)),
        }
    }

    /// The object's own name, or `kind index`.
    pub(super) fn name(&self, kind: &str, index: usize) -> Result<String, LoadError> {
        Ok(match self.string("name")? {
            Some(name) if !name.is_empty() => name.to_owned(),
            _ => format!("{kind} {index}"),
        })
    }

    pub(super) fn bool(&self, key: &str) -> Result<Option<bool>, LoadError> {
        match self.map.get(key) {
            None => Ok(None),
            Some(Value::Bool(b)) => Ok(Some(*b)),
            Some(value) => Err(self.wrong_type(key, "true or false", value)),
        }
    }

    pub(super) fn uint(&self, key: &str) -> Result<Option<u64>, LoadError> {
        match self.map.get(key) {
            None => Ok(None),
            Some(value) => match as_uint(value) {
                Some(n) => Ok(Some(n)),
                None => Err(self.wrong_type(key, "a whole number, not negative", value)),
            },
        }
    }

    /// A reference to one of `count` things.
    pub(super) fn index(
        &self,
        key: &str,
        what: &'static str,
        count: usize,
    ) -> Result<Option<usize>, LoadError> {
        match self.uint(key)? {
            None => Ok(None),
            Some(index) if index < count as u64 => Ok(Some(index as usize)),
            Some(index) => Err(self.context.out_of_range(self.at_key(key), what, index, count)),
        }
    }

    /// A list of references to `count` things.
    pub(super) fn indices(&self, key: &str, what: &'static str, count: usize) -> Result<Vec<u32>, LoadError> {
        let item = |(i, value)| {
            let at = || format!("{}[{i}]", self.at_key(key));
            match as_uint(value) {
                None => Err(wrong_type(self.context, at(), "a whole number, not negative", value)),
                Some(n) if n < count as u64 && n <= u64::from(u32::MAX) => Ok(n as u32),
                Some(n) => Err(self.context.out_of_range(at(), what, n, count)),
            }
        };
        self.array(key)?.iter().enumerate().map(item).collect()
    }

    pub(super) fn number(&self, key: &str) -> Result<Option<f32>, LoadError> {
        match self.map.get(key) {
            None => Ok(None),
            Some(value) => self.as_number(value, || self.at_key(key)).map(Some),
        }
    }

    pub(super) fn number_list(&self, key: &str) -> Result<Vec<f32>, LoadError> {
        let item = |(i, value)| self.as_number(value, || format!("{}[{i}]", self.at_key(key)));
        self.array(key)?.iter().enumerate().map(item).collect()
    }

    /// A list of exactly `N` numbers.
    pub(super) fn numbers<const N: usize>(&self, key: &str) -> Result<Option<[f32; N]>, LoadError> {
        if !self.has(key) {
            return Ok(None);
        }
        let list = self.number_list(key)?;
        match <[f32; N]>::try_from(list.as_slice()) {
            Ok(numbers) => Ok(Some(numbers)),
            Err(_) => {
                let problem = format!("must hold {N} numbers, but has {}; export the file again", list.len());
                Err(self.context.invalid(self.at_key(key), problem))
            }
        }
    }

    fn as_number(&self, value: &Value, at: impl Fn() -> String) -> Result<f32, LoadError> {
        match value.as_f64() {
            None => Err(wrong_type(self.context, at(), "a number", value)),
            Some(x) if is_usable(x as f32) => Ok(x as f32),
            Some(_) => Err(self.context.not_finite(at())),
        }
    }
}

/// Whole numbers, also written as `1.0` or `1e0`.
fn as_uint(value: &Value) -> Option<u64> {
    if let Some(n) = value.as_u64() {
        return Some(n);
    }
    let x = value.as_f64()?;
    ((0.0..=9e15).contains(&x) && x.fract() == 0.0).then_some(x as u64)
}

fn wrong_type(context: &Context<'_>, at: String, expected: &'static str, found: &Value) -> LoadError {
    let mut text = found.to_string();
    if text.chars().count() > 40 {
        text = text.chars().take(40).chain(['…']).collect();
    }
    LoadError::WrongType { file: context.file(), at, expected, found: text }
}
