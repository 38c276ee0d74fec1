// From a file beside the page. (make-worker-inline.ts is for a page that is one file.)
export function makeWorker(): Worker {
  return new Worker(new URL('./worker.ts', import.meta.url), { type: 'module' });
}
