export function compare() { return null; }
