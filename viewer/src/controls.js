// The panel beside the scene.
import { layers } from './scene.js';

const names = {
  source: 'Source',
  reference: 'Reference',
  'source-keys': 'Key points of the source',
  'reference-keys': 'Key points of the reference',
};
const one = (selector) => document.querySelector(selector);

function addLayers(stage) {
  for (const layer of layers) {
    const object = stage.objects[layer];
    const box = document.createElement('input');
    Object.assign(box, { type: 'checkbox', id: `show-${layer}`, checked: true });
    const swatch = Object.assign(document.createElement('span'), { className: 'swatch' });
    const [role, key] = layer.split('-');
    swatch.style.background = `var(--${role})`;
    if (key) swatch.classList.add('key');
    const label = document.createElement('label');
    label.append(box, swatch, names[layer]);
    box.addEventListener('change', () => stage.show(layer, box.checked));
    if (!object.geometry.attributes.position.count) box.disabled = true;
    one('#shown').append(label);
  }
}

function addSlider(stage) {
  const slider = one('#progress'), value = one('#progress-value'), play = one('#play');
  const set = (s) => {
    stage.move(s);
    value.textContent = `${Math.round(100 * s)} %`;
    slider.setAttribute('aria-valuetext', s === 0 ? 'as given' : s === 1 ? 'assembled' : value.textContent);
  };
  let frame;
  const stop = () => {
    cancelAnimationFrame(frame);
    frame = undefined;
    play.textContent = 'Play';
  };
  slider.addEventListener('input', () => {
    stop();
    set(slider.valueAsNumber);
  });
  play.addEventListener('click', () => {
    if (frame) return stop();
    const from = slider.valueAsNumber >= 1 ? 0 : slider.valueAsNumber;
    let start;
    const next = (now) => {
      start ??= now;
      slider.value = String(Math.min(1, from + (now - start) / 2500));
      set(slider.valueAsNumber);
      if (slider.valueAsNumber < 1) frame = requestAnimationFrame(next);
      else stop();
    };
    play.textContent = 'Stop';
    frame = requestAnimationFrame(next);
  });
  set(slider.valueAsNumber);
}

/** The poses to choose among, where there are several. */
function addPoses(stage, data, motions) {
  const choice = one('#pose');
  one('#poses').hidden = motions.length < 2;
  for (const { name } of data.poses) choice.append(Object.assign(document.createElement('option'), { textContent: name }));
  choice.addEventListener('change', () =>
    stage.follow(motions[choice.selectedIndex], one('#progress').valueAsNumber),
  );
}

export function addControls(stage, data, motions) {
  addLayers(stage);
  addSlider(stage);
  addPoses(stage, data, motions);
  const size = one('#size');
  const describe = () => size.setAttribute('aria-valuetext', `${(2 ** size.valueAsNumber).toFixed(2)} times`);
  size.addEventListener('input', () => {
    stage.scalePoints(2 ** size.valueAsNumber);
    describe();
  });
  describe();
  one('#reset').addEventListener('click', () => stage.resetView());
  one('#colouring').hidden = !(data.source.colors || data.reference.colors);
  for (const radio of document.getElementsByName('colouring'))
    radio.addEventListener('change', () => stage.useOwnColours(radio.value === 'cloud'));
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => stage.recolour());
}
