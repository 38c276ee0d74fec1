// From text within the page: browsers start no worker from a file beside a page that was not served.
import InlineWorker from './worker?worker&inline';

export function makeWorker(): Worker {
  return new InlineWorker();
}
