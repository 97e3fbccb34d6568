// MessagePack, as much of it as the bridge speaks. Objects are maps; whole numbers are integers, BigInts 64-bit ones.

const text = { encoder: new TextEncoder(), decoder: new TextDecoder() };

export function encode(value) {
  let bytes = new Uint8Array(1024);
  let view = new DataView(bytes.buffer);
  let at = 0;

  function room(count) {
    if (at + count > bytes.length) {
      const larger = new Uint8Array(2 * (at + count));
      larger.set(bytes);
      bytes = larger;
      view = new DataView(bytes.buffer);
    }
    const start = at;
    at += count;
    return start;
  }
  // Room first: making it may replace the view that is written to.
  function write(method, count, value) {
    const start = room(count);
    view[method](start, value);
  }
  const byte = (value) => write("setUint8", 1, value);

  function long(value) {
    byte(0xd3);
    write("setBigInt64", 8, value);
  }

  function number(value) {
    if (!Number.isSafeInteger(value) || Object.is(value, -0)) {
      byte(0xcb);
      write("setFloat64", 8, value);
    } else if (value >= -32 && value < 128) {
      byte(value & 0xff);
    } else if (value >= -0x80000000 && value < 0x80000000) {
      byte(0xd2);
      write("setInt32", 4, value);
    } else {
      long(BigInt(value));
    }
  }

  // The head of a string, an array or a map: `small` items fit into the first byte, up to 65535 into two more.
  function head(first, small, wide, count) {
    if (count < small) return byte(first | count);
    byte(wide);
    write("setUint16", 2, count);
  }

  function put(value) {
    if (value === null || value === undefined) byte(0xc0);
    else if (typeof value === "boolean") byte(value ? 0xc3 : 0xc2);
    else if (typeof value === "number") number(value);
    else if (typeof value === "bigint") long(value);
    else if (typeof value === "string") {
      const encoded = text.encoder.encode(value);
      head(0xa0, 32, 0xda, encoded.length);
      const start = room(encoded.length);
      bytes.set(encoded, start);
    } else if (Array.isArray(value)) {
      head(0x90, 16, 0xdc, value.length);
      value.forEach(put);
    } else {
      const entries = Object.entries(value);
      head(0x80, 16, 0xde, entries.length);
      for (const [key, item] of entries) {
        put(key);
        put(item);
      }
    }
  }

  put(value);
  return bytes.subarray(0, at);
}

// Integers that a Number cannot hold come back as BigInt.
export function decode(buffer) {
  const bytes = new Uint8Array(buffer);
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  let at = 0;

  function skip(count) {
    const start = at;
    at += count;
    return start;
  }
  const narrow = (value) => (value >= Number.MIN_SAFE_INTEGER && value <= Number.MAX_SAFE_INTEGER ? Number(value) : value);
  const string = (count) => text.decoder.decode(bytes.subarray(skip(count), at));
  const array = (count) => Array.from({ length: count }, take);

  function map(count) {
    const found = {};
    for (let n = 0; n < count; n++) {
      const key = take();
      found[key] = take();
    }
    return found;
  }

  function take() {
    const first = view.getUint8(skip(1));
    if (first < 0x80) return first;
    if (first < 0x90) return map(first & 0x0f);
    if (first < 0xa0) return array(first & 0x0f);
    if (first < 0xc0) return string(first & 0x1f);
    if (first >= 0xe0) return first - 0x100;
    switch (first) {
      case 0xc0: return null;
      case 0xc2: return false;
      case 0xc3: return true;
      case 0xca: return view.getFloat32(skip(4));
      case 0xcb: return view.getFloat64(skip(8));
      case 0xcc: return view.getUint8(skip(1));
      case 0xcd: return view.getUint16(skip(2));
      case 0xce: return view.getUint32(skip(4));
      case 0xcf: return narrow(view.getBigUint64(skip(8)));
      case 0xd0: return view.getInt8(skip(1));
      case 0xd1: return view.getInt16(skip(2));
      case 0xd2: return view.getInt32(skip(4));
      case 0xd3: return narrow(view.getBigInt64(skip(8)));
      case 0xd9: return string(view.getUint8(skip(1)));
      case 0xda: return string(view.getUint16(skip(2)));
      case 0xdc: return array(view.getUint16(skip(2)));
      case 0xde: return map(view.getUint16(skip(2)));
      default: throw new RangeError(`MessagePack: type 0x${first.toString(16)} is not spoken here`);
    }
  }

  return take();
}
