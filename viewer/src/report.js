// The result's JSON as tables, whatever keys it has.

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

const isObject = (value) => value !== null && typeof value === 'object' && !Array.isArray(value);
const isNested = (value) => value !== null && typeof value === 'object';
const words = (key) => key.replaceAll('_', ' ');

function numberText(value) {
  if (Number.isInteger(value)) return value.toLocaleString('en');
  const short = Math.abs(value) >= 1e-4 && Math.abs(value) < 1e6 ? Number(value.toPrecision(5)) : value;
  return short === value && String(value).length > 12 ? value.toExponential(3) : String(short);
}

function textOf(value) {
  if (value === null) return '–';
  if (typeof value === 'boolean') return value ? 'yes' : 'no';
  if (typeof value === 'number') return numberText(value);
  return value === '' ? '–' : String(value);
}

function table(rows, header) {
  const body = rows.map((row) =>
    element(
      'tr',
      {},
      ...row.map((value) =>
        element('td', {
          className: typeof value === 'number' ? 'number' : '',
          textContent: isNested(value) ? JSON.stringify(value) : textOf(value),
          title: typeof value === 'number' ? String(value) : '',
        }),
      ),
    ),
  );
  if (!header) return element('table', {}, ...body);
  const cells = header.map((key) => element('th', { scope: 'col', textContent: words(key) }));
  return element('table', {}, element('tr', {}, ...cells), ...body);
}

function list(values) {
  const numbers = values.every((value) => typeof value === 'number');
  if (numbers && values.length <= 16) return document.createTextNode(values.map(numberText).join(', '));
  if (numbers) return document.createTextNode(`${values.length} numbers`);
  if (values.every(Array.isArray)) {
    const flat = values.every((row) => row.every((value) => !isNested(value)));
    if (flat && values.length <= 16) return table(values);
    return document.createTextNode(`${values.length} rows`);
  }
  if (values.every(isObject)) {
    const keys = [...new Set(values.flatMap(Object.keys))];
    return table(values.map((value) => keys.map((key) => value[key] ?? null)), keys);
  }
  return element('ul', {}, ...values.map((value) => element('li', {}, rendered(value))));
}

function rendered(value) {
  if (Array.isArray(value)) return value.length ? list(value) : document.createTextNode('–');
  if (isObject(value)) return object(value);
  return document.createTextNode(textOf(value));
}

function entries(pairs) {
  const made = element('dl');
  for (const [key, value] of pairs) {
    const cell = element('dd', {}, rendered(value));
    if (typeof value === 'number') cell.title = String(value);
    if (key === 'status') cell.className = value === 'ok' ? 'good' : 'bad';
    made.append(element('dt', { textContent: words(key) }), cell);
  }
  return made;
}

const section = (key, value) =>
  element('details', { open: true }, element('summary', { textContent: words(key) }), rendered(value));

const isBlock = (value) =>
  isObject(value) || (Array.isArray(value) && value.some((item) => isNested(item)));

/** Plain values in one list, then whatever has parts of its own. */
function object(value) {
  const pairs = Object.entries(value);
  const plain = pairs.filter(([, inner]) => !isBlock(inner));
  const blocks = pairs.filter(([, inner]) => isBlock(inner));
  const made = element('div');
  if (plain.length) made.append(entries(plain));
  for (const [key, inner] of blocks) made.append(section(key, inner));
  return made;
}

const first = ['confidence', 'reasons', 'proposal', 'diagnostics', 'errors', 'transform'];
const rank = ([key]) => (first.includes(key) ? first.indexOf(key) : first.length);

/** How good the result is comes first, plain values about the run last. */
export function showReport(parent, report) {
  const pairs = Object.entries(report).sort((a, b) => rank(a) - rank(b));
  const plain = pairs.filter(([, value]) => !isBlock(value));
  const leading = plain.filter((pair) => rank(pair) < first.length);
  const others = plain.filter((pair) => rank(pair) === first.length);
  if (leading.length) parent.append(entries(leading));
  for (const [key, value] of pairs) if (isBlock(value)) parent.append(section(key, value));
  if (others.length) parent.append(section('run', Object.fromEntries(others)));
}
