//! One job from file to certified feed tables.
