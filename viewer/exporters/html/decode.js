"use strict";
// Unpacks the arrays that packing.py has written: integers as differences, in planes of bytes.

// Returns the bytes of deflated base64 text.
async function inflate(text) {
  const letters = atob(text.trim());
  const packed = new Uint8Array(letters.length);
  for (let i = 0; i < packed.length; ++i) packed[i] = letters.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Returns an array as {rows, columns, values}; the values are row by row, as 64-bit floats.
function unpackArray(item, bytes, items) {
  const [rows, columns] = item.shape, count = rows * columns;
  const values = new Float64Array(count), column = new Int32Array(rows);
  const near = item.near === undefined ? null : unpackArray(items[item.near], bytes, items).values;
  for (let c = 0; c < columns; ++c) {
    for (let r = 0; r < rows; ++r) {
      let coded = 0;
      for (let plane = 0; plane < item.planes; ++plane)
        coded |= bytes[item.at + plane * count + c * rows + r] << (8 * plane);
      column[r] = (coded >>> 1) ^ -(coded & 1);  // 0, 1, 2, 3 ... stand for 0, -1, 1, -2 ...
    }
    for (let order = 0; order < item.order; ++order)
      for (let r = 1; r < rows; ++r) column[r] += column[r - 1];  // wraps around at 32 bits
    for (let r = 1, at = 3; near && r < rows; ++r, at += 3)  // the rest of a parallelogram
      column[r] += column[r - near[at]] + column[r - near[at + 1]] - column[r - near[at + 2]];
    const step = Array.isArray(item.step) ? item.step[c] : item.step;
    const origin = Array.isArray(item.origin) ? item.origin[c] : item.origin;
    for (let r = 0; r < rows; ++r) values[r * columns + c] = column[r] * step + origin;
  }
  return { rows, columns, values };
}

// Returns arrays and pictures in the order of the items; pictures as decoded bitmaps.
async function unpackAll(items, text) {
  const bytes = await inflate(text);
  // Textures begin at their last row, and must keep the colours of transparent pixels.
  const how = { imageOrientation: "flipY", premultiplyAlpha: "none", colorSpaceConversion: "none" };
  return Promise.all(items.map((item) => {
    if (item.shape) return unpackArray(item, bytes, items);
    const file = bytes.subarray(item.at, item.at + item.size);
    return createImageBitmap(new Blob([file], { type: item.type }), how);
  }));
}
