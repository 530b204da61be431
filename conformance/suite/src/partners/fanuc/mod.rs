//! A simulated FANUC control: reader/punch interface and remote buffer.
