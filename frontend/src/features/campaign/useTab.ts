import { useSearchParams } from "react-router";

const TABS = ["trends", "flights", "statistics", "landscape"] as const;
type Tab = (typeof TABS)[number];

/** The open tab of a campaign's page, kept in the address so that going back and reloading show it again. */
export function useTab(): [Tab, (value: string | null) => void] {
  const [params, setParams] = useSearchParams();
  const tab = TABS.find((one) => one === params.get("tab")) ?? TABS[0];
  const open = (value: string | null): void =>
    setParams(
      (before) => {
        const after = new URLSearchParams(before);
        if (value === null || value === TABS[0]) after.delete("tab");
        else after.set("tab", value);
        return after;
      },
      { replace: true, preventScrollReset: true },
    );
  return [tab, open];
}
