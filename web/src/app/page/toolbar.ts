// The toolbar at the side, and the panels that its buttons open, one at a time.
import { element } from './element';
import { icon, type IconName } from './icons';
import type { Shortcuts } from './shortcuts';

export interface Tool {
  name: string; // for users: the button's label and the panel's heading
  key?: string; // shortcut that also opens it
  icon: IconName;
  panel?: HTMLElement; // if undefined, the button acts immediately
  opened?(): void;
  closed?(): void;
}

export class Toolbar {
  private readonly bar = element('div', 'glass toolbar');
  private readonly panels = new Map<Tool, { button: HTMLButtonElement; panel: HTMLElement }>();
  private current?: Tool;

  constructor(
    private readonly parent: HTMLElement,
    private readonly shortcuts: Shortcuts,
  ) {
    this.bar.setAttribute('role', 'toolbar');
    this.bar.setAttribute('aria-label', 'Tools');
    parent.append(this.bar);
    shortcuts.add('escape', 'Close the open panel', () => this.open(undefined));
  }

  add(tool: Tool): HTMLButtonElement {
    const button = element('button', '', icon(tool.icon));
    button.title = tool.key ? `${tool.name} (${tool.key.toUpperCase()})` : tool.name;
    button.setAttribute('aria-label', tool.name);
    button.addEventListener('click', () => this.toggle(tool));
    this.bar.append(button);
    if (tool.key) this.shortcuts.add(tool.key, tool.name, () => this.toggle(tool));
    if (!tool.panel) return button;
    const close = element('button', 'plain', icon('close'));
    close.setAttribute('aria-label', 'Close');
    close.addEventListener('click', () => this.open(undefined));
    const panel = element('section', 'glass side', element('header', '', element('h2', '', tool.name), close), tool.panel);
    panel.setAttribute('aria-label', tool.name);
    panel.hidden = true;
    this.parent.append(panel);
    button.setAttribute('aria-expanded', 'false');
    this.panels.set(tool, { button, panel });
    return button;
  }

  toggle(tool: Tool): void {
    if (!tool.panel) tool.opened?.();
    else this.open(this.current === tool ? undefined : tool);
  }

  open(tool: Tool | undefined): void {
    if (tool === this.current) return;
    const before = this.current;
    this.current = tool;
    for (const [one, { button, panel }] of this.panels) {
      panel.hidden = one !== tool;
      button.classList.toggle('on', one === tool);
      button.setAttribute('aria-expanded', String(one === tool));
    }
    // If it was closed by a key, the focus returns to the button that opened it.
    if (before && !tool && this.panels.get(before)!.panel.contains(document.activeElement)) this.panels.get(before)!.button.focus();
    before?.closed?.();
    tool?.opened?.();
  }
}
