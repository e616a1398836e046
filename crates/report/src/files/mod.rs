//! Parts of campaigns and studies as Parquet.

pub mod campaign_part;
pub mod study_part;
