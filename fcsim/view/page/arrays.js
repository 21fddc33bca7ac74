"use strict";
/* What the page holds, its arrays unpacked by a worker while plotly, the script after this one, is read. */

const run = JSON.parse(document.getElementById("content").textContent);

async function decode(entry) {
  const text = atob(entry.data), packed = new Uint8Array(text.length);
  for (let k = 0; k < packed.length; k++) packed[k] = text.charCodeAt(k);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const Type = { int8: Int8Array, int16: Int16Array, int32: Int32Array }[entry.type];
  const values = new Type(entry.n * entry.row), count = values.length;
  for (let byte = 0; byte < Type.BYTES_PER_ELEMENT; byte++)
    for (let k = 0, plane = byte * count, shift = 8 * byte; k < count; k++) values[k] |= planes[plane + k] << shift;
  for (let k = entry.row; k < count; k++) values[k] += values[k - entry.row];  // modulo the type's range
  return values;
}

function workerFor(entries) {  // decodes one entry after the other; where a browser allows no worker, the page does it itself
  const waiting = new Map(entries.map(entry => { let done; const values = new Promise(resolve => { done = resolve; }); return [entry, { values, done }]; }));
  const alone = () => waiting.forEach(({ done }, entry) => done(decode(entry)));
  try {
    const address = URL.createObjectURL(new Blob([`${decode}; onmessage = async ({ data }) => { for (const entry of data) { const values = await decode(entry); postMessage(values, [values.buffer]); } }`]));
    const worker = new Worker(address), left = [...entries];
    worker.onmessage = ({ data }) => { waiting.get(left.shift()).done(data); if (!left.length) { worker.terminate(); URL.revokeObjectURL(address); } };
    worker.onerror = event => { event.preventDefault(); worker.terminate(); alone(); };
    worker.postMessage(entries);
  } catch { alone(); }
  return entry => waiting.get(entry).values;
}

const packed = content => Object.values(content || {}).filter(entry => entry && entry.data !== undefined);
const { contacts: contactArrays, joints: jointArrays } = run.motion || {}, unpacked = workerFor([...packed(run.motion), ...packed(contactArrays), ...packed(jointArrays)]);

async function unpack(content) {
  const found = { ...content };
  for (const [name, entry] of Object.entries(content)) {
    if (!entry || entry.data === undefined) continue;
    const values = await unpacked(entry), scale = entry.scale;
    found[name] = scale === undefined ? values : { values, row: entry.row, at: k => values[k] * scale };
    entry.data = null;  // the text is not needed again
  }
  return found;
}
