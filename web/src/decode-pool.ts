// A pool of workers that decode contents.
import { makeWorker } from './make-worker';
import { SceneError } from './scene-error';
import type { Content, Resource } from './tiles/content-codec';
import type { ContentRequest, DecodeAnswer, DecodeRequest, ResourceRequest } from './worker';

interface Waiting {
  worker: Worker;
  resolve: (decoded: Content | Resource) => void;
  reject: (error: SceneError) => void;
}

export class DecodePool {
  private readonly workers: Worker[] = [];
  private readonly waiting = new Map<number, Waiting>();
  private next = 0;

  constructor(readonly size = Math.max(1, Math.min(4, (navigator.hardwareConcurrency || 2) - 1))) {}

  // Starts `count` workers, which prepare their decoders.
  start(count: number): void {
    for (let i = 0; i < Math.min(count, this.size); ++i) this.worker(i);
  }

  // Decodes a content. The file is transferred to the worker and must not be used afterwards. Resources are copied.
  decode(request: ContentRequest): Promise<Content> {
    return this.ask(request);
  }

  decodeResource(request: ResourceRequest): Promise<Resource> {
    return this.ask(request) as Promise<Resource>;
  }

  dispose(): void {
    for (const worker of this.workers) worker?.terminate();
    this.workers.length = 0;
    const gone = new SceneError('scene', '', 'was closed', 'open it again');
    for (const { reject } of this.waiting.values()) reject(gone);
    this.waiting.clear();
  }

  private ask(request: DecodeRequest): Promise<Content | Resource> {
    const id = this.next++;
    const worker = this.worker(id % this.size);
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { worker, resolve, reject });
      worker.postMessage({ id, ...request }, [request.file.buffer]);
    });
  }

  private worker(index: number): Worker {
    const known = this.workers[index];
    if (known) return known;
    const worker = makeWorker();
    worker.onmessage = ({ data }: MessageEvent<DecodeAnswer>) => {
      const waiting = this.waiting.get(data.id);
      this.waiting.delete(data.id);
      if ('decoded' in data) waiting?.resolve(data.decoded);
      else waiting?.reject(new SceneError(data.error.what, data.error.place, data.error.reason, data.error.remedy));
    };
    // The worker is replaced when the next content needs one.
    const leave = (message: string) => {
      worker.terminate();
      delete this.workers[index];
      const error = new SceneError('worker', '', message || 'could not be started', 'reload the page');
      for (const [id, waiting] of this.waiting) {
        if (waiting.worker !== worker) continue;
        this.waiting.delete(id);
        waiting.reject(error);
      }
    };
    worker.onerror = ({ message }) => leave(message);
    worker.onmessageerror = () => leave('sent a message that could not be read');
    this.workers[index] = worker;
    return worker;
  }
}
