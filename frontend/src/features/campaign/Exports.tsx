import { Button } from "@mantine/core";
import { pathOf, useDownload } from "../../api/files";
import type { Campaign } from "../../api/types";
import { ErrorNotice } from "../../ui/ErrorNotice";
import classes from "./CampaignHeader.module.css";

/** The campaign on paper, and as one file for another installation; what flies is not whole yet. */
export function Exports({ campaign }: { campaign: Campaign }) {
  const pdf = useDownload(pathOf(campaign.id, "report.pdf"));
  const bundle = useDownload(pathOf(campaign.id, "bundle"));
  return (
    <>
      <div className={classes["away"]}>
        <Button
          component="a"
          variant="default"
          href={pathOf(campaign.id, "report.html")}
          target="_blank"
          rel="noreferrer"
        >
          Report
        </Button>
        <Button variant="default" loading={pdf.isPending} onClick={() => pdf.mutate()}>
          PDF
        </Button>
        {campaign.flying === null && (
          <Button
            variant="default"
            loading={bundle.isPending}
            aria-label="Download bundle"
            onClick={() => bundle.mutate()}
          >
            Bundle
          </Button>
        )}
      </div>
      <ErrorNotice error={pdf.error ?? bundle.error} />
    </>
  );
}
