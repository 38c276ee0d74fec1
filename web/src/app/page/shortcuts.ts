// Keyboard shortcuts with their descriptions for the help.

export interface Shortcut {
  keys: string; // for users: "H", "W A S D"
  what: string;
}

export class Shortcuts {
  readonly list: Shortcut[] = [];
  areSuspended: () => boolean = () => false; // the keys do nothing
  private readonly actions = new Map<string, () => void>();

  constructor() {
    addEventListener('keydown', (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target) || this.areSuspended()) return;
      const action = this.actions.get(event.key.toLowerCase());
      if (!action) return;
      event.preventDefault();
      action();
    });
  }

  // `key` is that of KeyboardEvent.key, in lower case.
  add(key: string, what: string, action: () => void): void {
    if (this.actions.has(key)) throw new Error(`two actions for the key ${key}`);
    this.actions.set(key, action);
    this.describe(key.length === 1 ? key.toUpperCase() : `${key.charAt(0).toUpperCase()}${key.slice(1)}`, what);
  }

  // Adds a description only, for input that is handled elsewhere: held keys and the mouse.
  describe(keys: string, what: string): void {
    this.list.push({ keys, what });
  }
}

export function isTyping(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && target.matches('input:not([type=range], [type=checkbox]), textarea, select, [contenteditable]');
}
