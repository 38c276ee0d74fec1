// What the measuring tool says and asks.
import { element } from '../page/element';
import { icon } from '../page/icons';
import { kKinds, type Kind } from './measurement';
import { kKindNames, type Row } from './measurement-text';

export interface Kept {
  name: string;
  figure: string;
  isChosen: boolean;
}

function rowsInto(list: HTMLElement, rows: readonly Row[]): void {
  list.replaceChildren(...rows.flatMap(([name, value]) => [element('dt', '', name), element('dd', '', value)]));
  list.hidden = rows.length === 0;
}

function button(text: string, onClick: () => void): HTMLButtonElement {
  const made = element('button', '', text);
  made.addEventListener('click', onClick);
  return made;
}

export class MeasuringPanel {
  readonly element: HTMLElement;
  onKind: (kind: Kind) => void = () => {};
  onCopy: () => void = () => {};
  onChoose: (index: number) => void = () => {};
  onDelete: (index: number) => void = () => {};
  onDeleteAll: () => void = () => {};
  onDownload: () => void = () => {};
  private readonly kinds = new Map<Kind, HTMLButtonElement>();
  private readonly hint = element('p', 'faint');
  private readonly figures = element('dl', 'figures');
  private readonly place = element('dl');
  private readonly copy = button('Copy', () => this.onCopy());
  private readonly placePart = element('div', 'part', element('h3', '', 'Last place', this.copy), this.place);
  private readonly list = element('ul');
  private readonly listPart: HTMLElement;

  // `units`: what lengths are in, where they are not metres.
  constructor(units: string) {
    for (const kind of kKinds) this.kinds.set(kind, button(kKindNames[kind], () => this.onKind(kind)));
    const download = button('Download', () => this.onDownload());
    const deleteAll = button('Delete all', () => this.onDeleteAll());
    this.listPart = element('div', 'part', element('h3', '', 'Kept'), this.list, element('div', 'row', download, deleteAll));
    this.element = element(
      'div', 'measure', element('div', 'choice', ...this.kinds.values()), this.hint, this.figures, this.placePart, this.listPart);
    if (units !== '') this.element.append(element('p', 'faint part', units));
    this.showPlace([]);
    this.showKept([]);
  }

  showKind(kind: Kind, hint: string): void {
    this.kinds.forEach((one, name) => {
      one.classList.toggle('on', name === kind);
      one.setAttribute('aria-pressed', String(name === kind));
    });
    this.hint.textContent = hint;
  }

  showFigures(rows: readonly Row[]): void {
    rowsInto(this.figures, rows);
  }

  showPlace(rows: readonly Row[]): void {
    rowsInto(this.place, rows);
    this.placePart.hidden = rows.length === 0;
    this.copy.textContent = 'Copy';
  }

  showCopied(isCopied: boolean): void {
    this.copy.textContent = isCopied ? 'Copied' : 'Not allowed';
  }

  showKept(kept: readonly Kept[]): void {
    this.listPart.hidden = kept.length === 0;
    this.list.replaceChildren(...kept.map(({ name, figure, isChosen }, i) => {
      const choose = element('button', isChosen ? 'one on' : 'one', element('span', '', name), element('span', 'figure', figure));
      choose.addEventListener('click', () => this.onChoose(i));
      const remove = element('button', 'plain', icon('close'));
      remove.setAttribute('aria-label', `Delete ${name} ${figure}`);
      remove.addEventListener('click', () => this.onDelete(i));
      return element('li', '', choose, remove);
    }));
  }
}
