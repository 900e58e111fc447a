import { Button } from "@mantine/core";
import { pathOf, usePdf } from "../api/files";
import type { Campaign } from "../api/types";
import classes from "./CampaignHeader.module.css";
import { Trouble } from "./Trouble";

/** The campaign on paper, and as one file for another installation; what flies is not whole yet. */
export function TakeAway({ campaign }: { campaign: Campaign }) {
  const pdf = usePdf(campaign.id);
  const link = { component: "a", variant: "default" } as const;
  return (
    <>
      <div className={classes["away"]}>
        <Button {...link} href={pathOf(campaign.id, "report.html")} target="_blank" rel="noreferrer">
          Report
        </Button>
        <Button variant="default" loading={pdf.isPending} onClick={() => pdf.mutate()}>
          PDF
        </Button>
        {campaign.flying === null && (
          <Button {...link} href={pathOf(campaign.id, "bundle")} download aria-label="Download bundle">
            Bundle
          </Button>
        )}
      </div>
      <Trouble error={pdf.error} />
    </>
  );
}
