//! Where files are kept if not in the data folder: what `serve`, `doctor` and `backup` have to know alike.

use clap::Args;

use crate::config::{BucketSettings, BucketUrl};

/// A bucket of an S3 store.
#[derive(Debug, Clone, Args)]
pub(super) struct ObjectsArgs {
    /// Where scans and files of models and standards are kept instead of the data folder, such as s3://bucket/prefix, by the
    /// keys of AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY; the database stays in the folder
    #[arg(long, env = "VISAGE_OBJECTS", value_name = "URL")]
    objects: Option<BucketUrl>,
    /// The address of the S3 store, such as `https://s3.example` [default: Amazon's]
    #[arg(long, env = "AWS_ENDPOINT_URL", value_name = "URL")]
    objects_endpoint: Option<String>,
    /// The region of the S3 store [default: us-east-1]
    #[arg(long, env = "AWS_REGION", value_name = "NAME")]
    objects_region: Option<String>,
    /// Megabytes (10^6) of files of the bucket that are kept in the data folder at most, to be read again
    #[arg(long, env = "VISAGE_OBJECTS_CACHE_MB", value_name = "MB", default_value_t = 10_000)]
    objects_cache_mb: u64,
}

impl ObjectsArgs {
    /// The bucket, if there is one.
    pub(super) fn settings(&self) -> Option<BucketSettings> {
        Some(BucketSettings {
            url: self.objects.clone()?,
            endpoint: self.objects_endpoint.clone(),
            region: self.objects_region.clone(),
            cache_bytes: self.objects_cache_mb.saturating_mul(1_000_000),
        })
    }
}
