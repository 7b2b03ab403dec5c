// Requests with progress and readable errors.

/** All bytes of a file. */
export async function fetchBytes(url, signal, onProgress) {
  const chunks = [];
  let length = 0;
  await fetchChunks(
    url,
    signal,
    (chunk) => {
      chunks.push(chunk);
      length += chunk.length;
    },
    onProgress,
  );
  const bytes = new Uint8Array(length);
  let at = 0;
  for (const chunk of chunks) {
    bytes.set(chunk, at);
    at += chunk.length;
  }
  return bytes;
}

/** The bytes of a file as they come. `total` of the progress is null where the server does not say. */
export async function fetchChunks(url, signal, onChunk, onProgress) {
  let response;
  try {
    response = await fetch(url, { signal });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Error(`${url} cannot be fetched: the server does not answer, or does not allow other pages to read it.`);
  }
  if (!response.ok) throw new Error(`${url} cannot be fetched: the server says ${response.status} ${response.statusText}.`);
  // The length of what is sent is not that of what arrives where it is compressed on the way.
  const coded = response.headers.get("content-encoding");
  const length = Number(response.headers.get("content-length"));
  const total = length > 0 && !coded ? length : null;
  let loaded = 0;
  onProgress(loaded, total);
  const reader = response.body.getReader();
  for (;;) {
    let step;
    try {
      step = await reader.read();
    } catch (error) {
      if (error.name === "AbortError") throw error;
      throw new Error(`${url} broke off after ${loaded} bytes: ${error.message}`);
    }
    if (step.done) break;
    onChunk(step.value);
    loaded += step.value.length;
    onProgress(loaded, total);
  }
  onProgress(loaded, loaded);
}
