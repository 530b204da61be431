// Reads a program away from the page, which goes on: a worker.

import { compare } from './differences.js';
import { read } from './gcode.js';
import { index } from './lines.js';
import { signs } from './signs.js';

let bytes = null;
let starts = null;

self.onmessage = ({ data }) => {
  if (data.compare) {
    const result = compare(...data.compare.map((buffer) => new Uint8Array(buffer)));
    self.postMessage({ compared: result });
    return;
  }
  if (data.bytes) {
    bytes = new Uint8Array(data.bytes);
    starts = index(bytes);
    self.postMessage({ starts, signs: signs(bytes, starts) });
  }
  const path = read(bytes, starts, data.options, (part) => self.postMessage({ part }));
  self.postMessage({ path }, [path.points.buffer, path.pointLines.buffer, path.kinds.buffer]);
};
