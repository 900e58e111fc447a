/** The name that a Content-Disposition header gives a file; empty where it gives none. */
export function fileNameIn(disposition: string | null): string {
  const [, encoded, plain] = /filename\*=utf-8''([^;]+)|filename="([^"]*)"/i.exec(disposition ?? "") ?? [];
  return encoded === undefined ? (plain ?? "") : decodeURIComponent(encoded);
}
