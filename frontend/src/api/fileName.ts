/** The file name in a Content-Disposition header; empty if it has none. */
export function fileNameIn(disposition: string | null): string {
  const [, encoded, plain] = /filename\*=utf-8''([^;]+)|filename="([^"]*)"/i.exec(disposition ?? "") ?? [];
  return encoded === undefined ? (plain ?? "") : decodeURIComponent(encoded);
}
