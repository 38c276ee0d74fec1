// The tool for models in the city: it loads, places and saves them.
import * as THREE from 'three';
import { SceneError } from '../../scene-error';
import { DropTarget } from '../page/drop-target';
import { element } from '../page/element';
import { loadModel } from './load-model';
import { ModelGizmo } from './model-gizmo';
import { isModel, kAccepted, fileExtension, baseName, type ModelFile } from './model-files';
import { Models, type PlacedModel } from './models';
import { ModelsPanel } from './models-panel';
import { megabytes } from '../page/panels';
import { countFileBytes } from '../world/model-sources';
import type { Shortcuts } from '../page/shortcuts';
import type { Tool, Toolbar } from '../page/toolbar';
import { GroundFrame } from '../measuring/geodesy';
import { download } from '../page/page-files';
import type { Viewer } from '../viewer';
import { kWorldName } from '../world/world-file';
import { sceneList } from '../world/scene-list';
import type { Worlds } from '../world/worlds';

export function addModels(
  viewer: Viewer, models: Models, worlds: Worlds, toolbar: Toolbar, shortcuts: Shortcuts, fail: (error: unknown) => void,
): void {
  const { canvas, city } = viewer;
  const gizmo = new ModelGizmo(viewer, () => models.changed());
  let placed: PlacedModel | undefined; // the next click places it

  const askForPlace = (model: PlacedModel | undefined) => {
    placed = model;
    canvas.style.cursor = model ? 'crosshair' : '';
    viewer.navigation.isPointing = model !== undefined;
    panel.asks(model !== undefined);
  };
  const save = async (withFiles: boolean) => {
    download(kWorldName, await worlds.save(withFiles));
  };
  const panel = new ModelsPanel(models, gizmo, new GroundFrame(city.tileset.georeference), {
    add: () => picker.click(),
    save: (withFiles) => void save(withFiles).catch(fail),
    place: (model) => askForPlace(placed ? undefined : model),
  });
  panel.fileSize = () => megabytes(countFileBytes(models.list));

  const take = async (files: ModelFile[], place: THREE.Vector3) => {
    const mains = files.filter(isModel);
    // Models may be accompanied by JSON files of their own.
    const world = files.find(({ path }) => fileExtension(path) === 'json' && (mains.length === 0 || /^world\b/i.test(baseName(path))));
    if (files.length === 0) return;
    toolbar.open(tool);
    if (world) {
      await worlds.openFile(world, files, fail);
      return;
    }
    if (mains.length === 0) {
      throw new SceneError(baseName(files[0].path), '', 'is not a model', 'drop glTF, GLB, OBJ or FBX');
    }
    for (const main of mains) {
      await addModel(main, files, place).catch(fail);
    }
  };
  // The next model is placed beside this one.
  const addModel = async (main: ModelFile, files: ModelFile[], place: THREE.Vector3) => {
    const loaded = await loadModel(main, files);
    const model = models.add(Models.makeSource(loaded));
    model.position.copy(place);
    place.x += models.modelWidth(model);
    models.select(model);
    models.changed();
    if (loaded.lacking.length === 0) return;
    const names = `${loaded.lacking.slice(0, 3).join(', ')}${loaded.lacking.length > 3 ? ' and others' : ''}`;
    throw new SceneError(baseName(main.path), '', `is shown without ${names.slice(0, 200)}`, 'drop it together with its textures and materials, or their folder');
  };
  // The place under the pointer; else that in the centre of the image; else the target of the camera.
  const placeFor = (event?: DragEvent) => {
    const { left, top, width, height } = canvas.getBoundingClientRect();
    const middle = { clientX: left + width / 2, clientY: top + height / 2 };
    return (event && viewer.pickAt(event)) ?? viewer.pickAt(middle) ?? viewer.navigation.look.target;
  };
  const drop = new DropTarget(document.body, 'Drop the model where it should be placed', (files, event) => receive(files, event));
  const receive = (files: ModelFile[], event?: DragEvent) => {
    if (viewer.isPaused) {
      fail(new SceneError('viewer', '', 'is rendering an image', 'wait for it, or cancel it'));
      return;
    }
    const place = placeFor(event);
    void drop.during('Reading', take(files, place)).catch(fail);
  };

  const picker = element('input');
  picker.type = 'file';
  picker.multiple = true;
  picker.accept = kAccepted;
  picker.hidden = true;
  picker.addEventListener('change', () => {
    receive([...picker.files!].map((file) => ({ path: file.name, file })));
    picker.value = '';
  });
  panel.body.prepend(sceneList(viewer));
  panel.body.append(picker);

  models.onChange.add(() => {
    gizmo.attach(models.selected?.visible ? models.selected : undefined);
    if (placed && !models.list.includes(placed)) askForPlace(undefined);
  });
  const tool: Tool = {
    name: 'Models', key: 'o', icon: 'cube', panel: panel.body,
    closed: () => {
      askForPlace(undefined);
      models.select(undefined);
    },
  };
  toolbar.add(tool);
  shortcuts.add('t', 'Move, turn or scale the selected model', () => models.selected && gizmo.nextMode());
  shortcuts.add('delete', 'Delete the selected model', () => models.selected && models.remove(models.selected));
  viewer.onClick.push((event) => {
    if (placed) {
      const { visible } = placed;
      placed.visible = false; // it must neither be picked itself nor end the rays of the image in which the place is picked
      viewer.draw();
      const place = viewer.pickAt(event);
      placed.visible = visible;
      viewer.needPicture();
      if (!place) return true;
      placed.position.copy(place);
      askForPlace(undefined);
      models.changed();
      return true;
    }
    if (gizmo.takesClick()) return true;
    const model = models.at(event);
    if (model) toolbar.open(tool);
    models.select(model);
    return model !== undefined;
  });
}
