import { useEffect } from "react";

/** The tab's title: the page first, so that several tabs can be told apart. */
export function useTitle(page: string): void {
  useEffect(() => {
    document.title = `${page} · Gainline`;
  }, [page]);
}
