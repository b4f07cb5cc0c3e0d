//! One job from program items to certified feed tables.
//!
//! A reader thread runs the interpreter and the geometry; the sections it yields are planned and certified in
//! parallel, in batches of bounded size, and come out in program order whatever the thread count.
