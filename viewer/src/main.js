import { addControls } from './controls.js';
import { readData } from './data.js';
import { Motion, poseAt } from './motion.js';
import { showReport } from './report.js';
import { Stage } from './scene.js';

const one = (selector) => document.querySelector(selector);

function notesOf(data) {
  const count = (number) => number.toLocaleString('en');
  const lines = ['source', 'reference'].map((role) => {
    const { count: all, shown } = data[role];
    const thinned = shown < all ? `, thinned evenly to ${count(shown)}` : '';
    return `${role}: ${count(all)} ${all === 1 ? 'point' : 'points'}${thinned}`;
  });
  if (data.brought_closer) lines.push('“Before” is drawn closer to the reference than it was given.');
  return lines.join('\n');
}

const data = readData(one('#data'));
const title = `${data.source.name} → ${data.reference.name}`;
document.title = title;
one('h1').textContent = title;
one('#notes').textContent = notesOf(data);
showReport(one('#report'), data.report);

const motions = data.poses.map(({ rotation, after }) => new Motion(rotation, data.before, after));
let stage;
try {
  stage = new Stage(one('#scene'), data, motions[0]);
  addControls(stage, data, motions);
} catch (error) {
  one('form').hidden = true;
  one('#message').hidden = false;
  one('#message').textContent = `This browser cannot draw the clouds: ${error.message}`;
}

// For scripts, and for a person at the console.
window.bitr = { data, poseAt: (s) => poseAt(stage?.motion ?? motions[0], data, s) };
