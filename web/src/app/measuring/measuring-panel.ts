// The panel of the measuring tool.
import { element } from '../page/element';
import { iconButton, replaceRows, showPressed } from '../page/fields';
import { kKinds, type Kind } from './measurement';
import { kKindNames, type Row } from './measurement-text';

export interface ListedMeasurement {
  name: string;
  figure: string;
  isChosen: boolean;
}

function rowsInto(list: HTMLElement, rows: readonly Row[]): void {
  list.replaceChildren(...rows.flatMap(([name, value]) => [element('dt', '', name), element('dd', '', value)]));
  list.hidden = rows.length === 0;
}

function button(text: string, onClick: () => void): HTMLButtonElement {
  const control = element('button', '', text);
  control.addEventListener('click', onClick);
  return control;
}

export class MeasuringPanel {
  readonly element: HTMLElement;
  onKind: (kind: Kind) => void = () => {};
  onDone: () => void = () => {};
  onUndo: () => void = () => {};
  onCopy: () => void = () => {};
  onChoose: (index: number) => void = () => {};
  onDelete: (index: number) => void = () => {};
  onDeleteAll: () => void = () => {};
  onDownload: () => void = () => {};
  private readonly kinds = new Map<Kind, HTMLButtonElement>();
  private readonly hint = element('p', 'faint');
  private readonly undo = button('Undo', () => this.onUndo());
  private readonly done = button('Done', () => this.onDone());
  private readonly steps = element('div', 'steps', this.undo, this.done);
  private readonly figures = element('dl', 'figures');
  private readonly place = element('dl');
  private readonly copy = button('Copy', () => this.onCopy());
  private readonly placePart = element('div', 'part', element('h3', '', 'Last place', this.copy), this.place);
  private readonly list = element('ul');
  private readonly listPart: HTMLElement;

  // `units` names the unit of lengths if it is not the metre.
  constructor(units: string) {
    for (const kind of kKinds) this.kinds.set(kind, button(kKindNames[kind], () => this.onKind(kind)));
    this.undo.title = 'Undo the last place (Backspace)';
    this.done.title = 'Finish (Enter)';
    const choice = element('div', 'choice', ...this.kinds.values());
    choice.setAttribute('role', 'group');
    choice.setAttribute('aria-label', 'Kind of measurement');
    const download = button('Download', () => this.onDownload());
    const deleteAll = button('Delete all', () => this.onDeleteAll());
    this.listPart = element('div', 'part', element('h3', '', 'Kept'), this.list, element('div', 'row', download, deleteAll));
    this.element = element(
      'div', 'measure', choice, element('div', 'task', this.hint, this.steps), this.figures, this.placePart, this.listPart);
    if (units !== '') this.element.append(element('p', 'faint part', units));
    this.showPlace([]);
    this.showMeasurements([]);
  }

  // `isEnough` is true when the measurement that was begun can be finished.
  showTask(kind: Kind, hint: string, isBegun: boolean, isEnough: boolean): void {
    showPressed(this.kinds, kind);
    this.hint.textContent = hint;
    // A button that is removed passes the keyboard focus to one that remains.
    const { activeElement } = document;
    const goes = (activeElement === this.undo && !isBegun) || (activeElement === this.done && !isEnough);
    this.done.disabled = !isEnough;
    this.steps.hidden = !isBegun;
    if (goes) (isBegun ? this.undo : this.kinds.get(kind)!).focus();
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

  showMeasurements(rows: readonly ListedMeasurement[]): void {
    this.listPart.hidden = rows.length === 0;
    replaceRows(this.list, rows.map(({ name, figure, isChosen }, i) => {
      const choose = element('button', isChosen ? 'one on' : 'one', element('span', '', name), element('span', 'figure', figure));
      choose.addEventListener('click', () => this.onChoose(i));
      choose.setAttribute('aria-pressed', String(isChosen));
      return element('li', '', choose, iconButton('Delete', `${name} ${figure}`, 'close', () => this.onDelete(i)));
    }));
  }
}
