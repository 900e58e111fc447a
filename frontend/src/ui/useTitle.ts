import { useEffect } from "react";

/** Set the tab's title, with the page's name first. */
export function useTitle(page: string): void {
  useEffect(() => {
    document.title = `${page} · Gainline`;
  }, [page]);
}
