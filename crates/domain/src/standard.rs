//! Standards made by users: the classes, and the examples marked for them.

use super::{AssetRecord, ModelId, StandardId};
use visage_geometry::Unit;
use visage_shape::standards::{Annotation, Standard};

/// A standard that is to be stored.
#[derive(Debug, Clone)]
pub struct NewStandard {
    /// Its id.
    pub id: StandardId,
    /// Its name: unique.
    pub name: String,
    /// The file it was made of.
    pub asset: AssetRecord,
    /// The unit of that file.
    pub unit: Unit,
    /// The landmarks as they were given.
    pub annotation: Annotation,
    /// What was made of them.
    pub definition: Standard,
    /// Models of the class, and others.
    pub examples: Examples,
}

/// A stored standard.
#[derive(Debug, Clone)]
pub struct StandardRecord {
    /// Its id.
    pub id: StandardId,
    /// Its name.
    pub name: String,
    /// The file it was made of.
    pub asset: AssetRecord,
    /// The unit of that file.
    pub unit: Unit,
    /// The landmarks as they were given.
    pub annotation: Annotation,
    /// What was made of them.
    pub definition: Standard,
}

/// Models that were marked for a standard.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Examples {
    /// Those of its class.
    pub positive: Vec<ModelId>,
    /// Others.
    pub negative: Vec<ModelId>,
}
