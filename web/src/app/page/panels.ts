// What stands over the picture: how far loading is, what went wrong, numbers.
import type { SceneError } from '../../scene-error';
import type { SceneStatistics } from '../../scene';
import type { Frame } from '../viewer';
import { element } from './element';
import { FrameRate, inDigits } from './frame-rate';

export function megabytes(bytes: number): string {
  return bytes < 1e6 ? `${Math.round(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(bytes < 1e7 ? 1 : 0)} MB`;
}

export class LoadingPanel {
  private readonly name = element('span');
  private readonly bytes = element('span', 'bytes');
  private readonly bar = element('i');
  private readonly panel = element(
    'div', 'glass loading', element('div', 'name', this.name, this.bytes), element('div', 'bar', this.bar));
  private most = 1; // tiles on their way since the last rest

  constructor(parent: HTMLElement) {
    this.name.textContent = 'Opening the scene';
    this.panel.setAttribute('role', 'status');
    parent.append(this.panel);
  }

  show(name: string, { fetchedBytes, pending }: SceneStatistics, idle: boolean): void {
    this.most = idle ? 1 : Math.max(this.most, pending);
    this.name.textContent = name === '' ? 'Loading' : name;
    this.bytes.textContent = megabytes(fetchedBytes);
    this.bar.style.width = `${idle ? 100 : Math.round(100 * (1 - pending / (this.most + 1)))}%`;
    this.panel.classList.toggle('done', idle);
  }

  hide(): void {
    this.panel.classList.add('done');
  }
}

export class ErrorPanel {
  private readonly what = element('h2');
  private readonly reason = element('p');
  private readonly remedy = element('p');
  private readonly count = element('summary');
  private readonly others = element('ul');
  private readonly more = element('details', '', this.count, this.others);
  private shown: SceneError[] = []; // since it was closed, the last one first
  private readonly panel: HTMLElement;

  constructor(parent: HTMLElement) {
    const close = element('button', '', 'Close');
    close.addEventListener('click', () => (this.panel.hidden = true));
    this.panel = element('div', 'glass error', close, this.what, this.reason, this.remedy, this.more);
    this.panel.setAttribute('role', 'alert');
    this.panel.hidden = true;
    parent.append(this.panel);
  }

  hide(): void {
    this.panel.hidden = true;
  }

  // The last one, and those that came before it since it was closed.
  show(error: SceneError): void {
    const kMost = 50;
    this.shown = [error, ...(this.panel.hidden ? [] : this.shown)].slice(0, kMost);
    const sentence = (text: string) => `${text.charAt(0).toUpperCase()}${text.slice(1)}.`;
    this.what.textContent = titleOf(error);
    this.reason.textContent = sentence(error.reason);
    this.remedy.textContent = sentence(error.remedy);
    const others = this.shown.slice(1);
    this.more.hidden = others.length === 0;
    this.count.textContent = `And ${others.length} more`;
    this.others.replaceChildren(...others.map((one) => element('li', '', `${titleOf(one)}: ${one.reason}`)));
    this.panel.hidden = false;
  }
}

function titleOf({ what, place }: SceneError): string {
  return place === '' ? what : `${what}, ${place}`;
}

export class StatisticsPanel {
  private readonly list = element('dl');
  private readonly frame = element('dd', '', 'at rest');
  private readonly rate = new FrameRate((text) => (this.frame.textContent = text));
  private readonly panel = element('div', 'glass statistics', this.list);

  constructor(parent: HTMLElement) {
    this.panel.hidden = true;
    parent.append(this.panel);
    document.addEventListener('visibilitychange', () => this.rate.rest()); // there are no animation frames out of sight
  }

  toggle(): void {
    this.panel.hidden = !this.panel.hidden;
  }

  show(statistics: SceneStatistics, { milliseconds, gpuMilliseconds, resolutionScale }: Frame): void {
    if (this.panel.hidden) return;
    this.rate.drew(milliseconds);
    const rows: [string, string][] = [
      ['Drawing', gpuMilliseconds === undefined ? 'not told' : `${inDigits(gpuMilliseconds)} ms`],
      ['Resolution', `${Math.round(100 * resolutionScale)} %`],
      ['Graphics card', megabytes(statistics.cardBytes + statistics.targetBytes)],
      ['Page', megabytes(statistics.pageBytes)],
      ['Fetched', megabytes(statistics.fetchedBytes)],
      ['On their way', String(statistics.pending)],
      ...(statistics.refused > 0 ? [['No room for', `${statistics.refused} blocks`] satisfies [string, string]] : []),
      ...statistics.drawn.map((count, level): [string, string] => [`Blocks of level ${level}`, String(count)]),
    ];
    const list = rows.flatMap(([name, value]) => [element('dt', '', name), element('dd', '', value)]);
    this.list.replaceChildren(element('dt', '', 'Frame'), this.frame, ...list);
  }
}
