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

/** One cell's text; whole numbers of a matrix would be taken for counts, so they keep no commas. */
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

/** What a status says of itself, in colour beside the word. */
function judgement(key, value) {
  if (key === 'status') return value === 'ok' ? 'good' : 'bad';
  return '';
}

function entries(pairs) {
  return element(
    'dl',
    {},
    ...pairs.flatMap(([key, value]) => [
      element('dt', { textContent: words(key) }),
      element('dd', { className: judgement(key, value), title: typeof value === 'number' ? String(value) : '' }, rendered(value)),
    ]),
  );
}

function section(key, content, open) {
  return element('details', { open }, element('summary', { textContent: words(key) }), content);
}

const isBlock = (value) =>
  isObject(value) || (Array.isArray(value) && value.some((item) => isNested(item)));

/** Plain values in one list, then whatever has parts of its own. */
function object(value) {
  const pairs = Object.entries(value);
  const plain = pairs.filter(([, inner]) => !isBlock(inner));
  const blocks = pairs.filter(([, inner]) => isBlock(inner));
  const made = element('div');
  if (plain.length) made.append(entries(plain));
  for (const [key, inner] of blocks) made.append(section(key, rendered(inner), true));
  return made;
}

const first = ['confidence', 'diagnostics', 'errors', 'transform'];
const rank = ([key]) => (first.includes(key) ? first.indexOf(key) : first.length);

/** How good the result is comes first, what has no parts last. */
export function showReport(parent, report) {
  const pairs = Object.entries(report).sort((a, b) => rank(a) - rank(b));
  for (const [key, value] of pairs) if (isBlock(value)) parent.append(section(key, rendered(value), true));
  const plain = pairs.filter(([, value]) => !isBlock(value));
  if (plain.length) parent.append(section('run', entries(plain), true));
}
