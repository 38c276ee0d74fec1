// Makes the whole page accept files that are dragged onto it.
import { element } from './element';
import type { ModelFile } from '../models/model-files';

const kMaxFiles = 10000;
const kDepth = 16; // limit on the nesting of folders

export class DropTarget {
  private readonly words = element('span');
  private readonly overlay = element('div', 'drop', this.words);

  constructor(parent: HTMLElement, what: string, take: (files: ModelFile[], event: DragEvent) => void) {
    this.overlay.hidden = true;
    parent.append(this.overlay);
    const holdsFiles = ({ dataTransfer }: DragEvent) => dataTransfer?.types.includes('Files') ?? false;
    addEventListener('dragover', (event) => {
      if (!holdsFiles(event)) return;
      event.preventDefault();
      this.words.textContent = what;
      this.overlay.hidden = false;
    });
    addEventListener('dragleave', ({ relatedTarget }) => {
      if (relatedTarget === null) this.overlay.hidden = true;
    });
    addEventListener('drop', (event) => {
      if (!holdsFiles(event)) return;
      event.preventDefault();
      this.overlay.hidden = true;
      void droppedFiles(event.dataTransfer!).then((files) => take(files, event));
    });
  }

  // Shows a message until the work is done.
  async during<T>(what: string, work: Promise<T>): Promise<T> {
    this.words.textContent = what;
    this.overlay.hidden = false;
    try {
      return await work;
    } finally {
      this.overlay.hidden = true;
    }
  }
}

// Returns all files, including those in folders. The items of `dropped` are only accessible synchronously.
async function droppedFiles(dropped: DataTransfer): Promise<ModelFile[]> {
  const items = [...dropped.items].filter(({ kind }) => kind === 'file');
  const entries = items.map((item) => ({ entry: item.webkitGetAsEntry?.(), file: item.getAsFile() }));
  const files: ModelFile[] = [];
  for (const { entry, file } of entries) {
    if (entry?.isDirectory) await walk(entry as FileSystemDirectoryEntry, '', kDepth, files);
    else if (file) files.push({ path: file.name, file });
  }
  return files;
}

async function walk(folder: FileSystemDirectoryEntry, above: string, depth: number, files: ModelFile[]): Promise<void> {
  const reader = folder.createReader();
  const path = `${above}${folder.name}/`;
  for (;;) {
    const some = await new Promise<FileSystemEntry[]>((resolve) => reader.readEntries(resolve, () => resolve([])));
    if (some.length === 0 || files.length >= kMaxFiles) return;
    for (const entry of some) {
      if (entry.isDirectory && depth > 0) await walk(entry as FileSystemDirectoryEntry, path, depth - 1, files);
      if (!entry.isFile) continue;
      const file = await new Promise<File | undefined>((resolve) => (entry as FileSystemFileEntry).file(resolve, () => resolve(undefined)));
      if (file) files.push({ path: `${path}${file.name}`, file });
    }
  }
}
