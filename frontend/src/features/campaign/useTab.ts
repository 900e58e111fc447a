import { useSearchParams } from "wouter";

const TABS = ["trends", "flights", "statistics"] as const;

/** The open tab of a campaign's page, kept in the address so that going back and reloading show it again; the first for
 * an address that names none of them. */
export function useTab(): [string, (tab: string | null) => void] {
  const [params, setParams] = useSearchParams();
  const tab = TABS.find((one) => one === params.get("tab")) ?? TABS[0];
  const open = (value: string | null): void =>
    setParams(value === null || value === TABS[0] ? {} : { tab: value }, { replace: true });
  return [tab, open];
}
