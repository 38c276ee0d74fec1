// Creates the worker from a file beside the page. (make-worker-inline.ts is for the viewer as a single file.)
export function makeWorker(): Worker {
  return new Worker(new URL('./worker.ts', import.meta.url), { type: 'module' });
}
