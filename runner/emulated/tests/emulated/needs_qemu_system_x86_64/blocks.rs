//! 3964R with a partner that answers at once.
