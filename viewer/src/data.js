// What the command has written into the page.

function bytesOf(text) {
  const letters = atob(text);
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < bytes.length; ++i) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

/** Little-endian on every machine. */
function floatsOf(text) {
  const bytes = bytesOf(text);
  const view = new DataView(bytes.buffer);
  const floats = new Float32Array(bytes.length / 4);
  for (let i = 0; i < floats.length; ++i) floats[i] = view.getFloat32(4 * i, true);
  return floats;
}

function cloudOf(cloud) {
  return {
    ...cloud,
    positions: floatsOf(cloud.positions),
    keyPoints: floatsOf(cloud.key_points),
    normals: new Int8Array(bytesOf(cloud.normals).buffer),
    colors: cloud.colors && bytesOf(cloud.colors),
  };
}

export function readData(element) {
  const data = JSON.parse(element.textContent);
  return { ...data, source: cloudOf(data.source), reference: cloudOf(data.reference) };
}
