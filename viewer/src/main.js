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

const motion = new Motion(data.rotation, data.before, data.after);
try {
  const stage = new Stage(one('#scene'), data, motion);
  addControls(stage, data);
} catch (error) {
  one('form').hidden = true;
  one('#message').hidden = false;
  one('#message').textContent = `This browser cannot draw the clouds: ${error.message}`;
}

// For scripts, and for a person at the console.
window.bitr = { data, poseAt: (s) => poseAt(motion, data, s) };
