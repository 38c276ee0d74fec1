// Creates the worker from text in the page: browsers do not start workers from files beside a page that was not served.
import InlineWorker from './worker?worker&inline';

export function makeWorker(): Worker {
  return new InlineWorker();
}
