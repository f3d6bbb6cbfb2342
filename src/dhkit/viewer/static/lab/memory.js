// What a page keeps while its window is open.

export function remembered(name, otherwise) {
  try {
    return sessionStorage.getItem(`dhkit-${name}`) ?? otherwise;
  } catch {
    return otherwise;
  }
}

export function remember(name, value) {
  try {
    sessionStorage.setItem(`dhkit-${name}`, value);
  } catch {
    // A page without storage forgets.
  }
}
